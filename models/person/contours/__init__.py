"""Contours of bones in image slices, drawn by a few clicks (thesis, Chapter 2), and their points in mm."""
