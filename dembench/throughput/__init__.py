"""How fast engines are: the same settled bed, law, step and output for all of them, timed in turn."""
