"""The Simulator View: a page in the browser to see the robot, drive it, and lay simulation beside reality."""
