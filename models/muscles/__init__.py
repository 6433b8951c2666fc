"""Muscle lines of the shoulder: attachments, paths round thorax and humerus, moment arms, contact and balance."""
