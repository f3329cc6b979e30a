//! The tests of the crate in one program, which links in the time of one: each file here is a module of it.
mod arms;
mod dynamics;
mod model_check;
mod payload;
mod same_bits;
mod trigonometry;
