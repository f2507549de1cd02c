"""Matrix products that warn of nothing that did not happen."""

import numpy as np


def product(a, b, out=None):
    """Return ``a @ b`` without warnings of invalid values.

    With AVX-512, OpenBLAS 0.3.31 multiplies float32 rows of five numbers by a vector
    in registers that it fills up with whatever lies on the stack. It drops those
    results, but NumPy warns of them if the stack held a signalling NaN.
    """
    with np.errstate(invalid="ignore"):
        return np.matmul(a, b, out=out)
