//! Tests of the alarms tab: what its operator sees, and what his keys do.
