"""Registration: poses of robot and camera relative to the phantom, with their uncertainty.

`registration` relates all frames of a dataset, `robot_fit` uses the touched landmarks, and
`camera_fit` the rest cloud.
"""
