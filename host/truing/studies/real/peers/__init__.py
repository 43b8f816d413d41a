"""Other ways to model a drivetrain, each fitted to the rows that the diagnosis had."""
