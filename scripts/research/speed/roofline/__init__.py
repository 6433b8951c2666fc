"""Where the time of the machine code goes: what this machine reaches at best, and what an iteration consists of."""
