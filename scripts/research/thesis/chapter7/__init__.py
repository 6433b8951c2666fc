"""The parts of `study_chapter7.py`: one question of the thesis's chapter 7 each."""
