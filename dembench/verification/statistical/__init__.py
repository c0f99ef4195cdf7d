"""The suite of bulk behaviour that only ensembles show: cooling, packing, silos, heaps, collapse, flow on inclines."""
