"""Registration: poses of robot and camera relative to the phantom, with their uncertainty.

`registration` relates all frames of a dataset, `robot_statements` uses touches, traces and stated
poses, and `rest_fit` the rest cloud.
"""
