"""An example of a package that adds to the mission vocabulary of cssr_system."""
