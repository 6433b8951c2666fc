"""Attachments carried from bone to bone, by landmarks or surfaces, and how far they are from measured ones."""
