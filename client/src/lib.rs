//! What a train controller links: publish samples, poll parameter snapshots.
