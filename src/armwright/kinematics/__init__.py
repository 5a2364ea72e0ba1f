"""Arms stacked in arrays: inverse kinematics, torques, clearance and dynamics."""
