//! Scenarios, simulator and process harness for the tests of Dynocar.
