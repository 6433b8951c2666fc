"""Does `girdle` name a wrong landmark, a wrong sign or a swap, and leave a correct trial alone?"""
