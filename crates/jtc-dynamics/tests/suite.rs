//! All tests of the crate in one program, so that only one program must be linked. Each file here is a module of it.
mod arms;
mod dynamics;
mod model_check;
mod payload;
mod same_bits;
mod trigonometry;
