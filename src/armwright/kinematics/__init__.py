"""Inverse kinematics and gravity torque of many arms at many targets at once."""
