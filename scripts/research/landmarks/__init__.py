"""Is a wrong landmark, a wrong sign or a swap named, and a sound trial left alone?"""
