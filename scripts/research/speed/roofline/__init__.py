"""Where does the time of the machine code go? Peak performance of this machine, and the operations of an iteration."""
