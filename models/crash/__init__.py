"""What all crash models share: the scenario, contact on the segments, the record, the outputs."""
