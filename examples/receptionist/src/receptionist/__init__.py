"""An example of a package that hears free speech: the receptionist of D2.1."""
