//! The tables of reactions in docs/safety.md must agree with the behaviour of the controller. With `UPDATE_DOCS=1`, the
//! test updates these tables.
use sim_checks::matrix::{contact_table, fault_matrix, standstill_table, stopping_table};

#[test]
fn j12_j14_j16_j21_j22_each_fault_in_each_state_has_the_documented_reaction() {
    // A single test checks all tables, because all tables are written to one file.
    documented("fault matrix", &fault_matrix().unwrap_or_else(|error| panic!("{error}")));
    documented("standstill", &standstill_table().unwrap_or_else(|error| panic!("{error}")));
    documented("stopping", &stopping_table().unwrap_or_else(|error| panic!("{error}")));
    documented("contact", &contact_table().unwrap_or_else(|error| panic!("{error}")));
}

/// Checks that the table with this name in docs/safety.md is equal to `table`, or updates the file.
fn documented(name: &'static str, table: &str) {
    println!("{table}");
    test_kit::page::part("safety.md", name, table);
}
