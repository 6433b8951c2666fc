"""Files of a laboratory, images and persons, on the command line."""
