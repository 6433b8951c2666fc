"""Contours of bones in image slices, found from a few clicks (thesis, Chapter 2), and their points in mm."""
