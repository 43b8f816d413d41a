"""The Simulator View: browser pages that show the robot, drive it and compare it with its simulation."""
