"""The suite of closed forms: collisions, bounces, sliding, statics, chains and conservation laws."""
