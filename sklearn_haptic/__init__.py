"""Predict how a crowd will rate an object's feel, from one robotic touch."""
