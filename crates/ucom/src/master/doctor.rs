//! What is wrong with a bus, in words with the next command.
