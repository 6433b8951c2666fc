"""Commands on landmark files, images and parameter sets of persons."""
