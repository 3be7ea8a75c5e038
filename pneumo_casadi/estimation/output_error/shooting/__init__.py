"""The multiple-shooting problem: segments, intervals, anchor of the flow map, condensing."""
