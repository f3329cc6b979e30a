//! All tests of the crate in one test program, which shortens linking. Each file of this directory is a module of the program.
mod arms;
mod dynamics;
mod model_check;
mod payload;
mod same_bits;
mod trigonometry;
