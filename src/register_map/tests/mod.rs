//! Small files of each form, with what is taken of them and what is not.

mod older;
