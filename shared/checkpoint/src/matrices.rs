//! Matrices of fixed size, and complex numbers.

use nalgebra::{Complex, SMatrix};

use crate::reader::CheckpointReader;
use crate::state::{Checkpoint, CheckpointValue};
use crate::writer::CheckpointWriter;

impl<const R: usize, const C: usize> Checkpoint for SMatrix<f64, R, C> {
    fn save(&self, to: &mut CheckpointWriter<'_>) {
        self.iter().for_each(|element| element.save(to));
    }
    fn load(&mut self, from: &mut CheckpointReader<'_>) {
        self.iter_mut().for_each(|element| element.load(from));
    }
}

impl<const R: usize, const C: usize> CheckpointValue for SMatrix<f64, R, C> {
    fn read(from: &mut CheckpointReader<'_>) -> Self {
        Self::from_fn(|_, _| 0.0).map(|_| f64::read(from))
    }
}

impl Checkpoint for Complex<f64> {
    fn save(&self, to: &mut CheckpointWriter<'_>) {
        self.re.save(to);
        self.im.save(to);
    }
    fn load(&mut self, from: &mut CheckpointReader<'_>) {
        *self = Self::read(from);
    }
}

impl CheckpointValue for Complex<f64> {
    fn read(from: &mut CheckpointReader<'_>) -> Self {
        let re = f64::read(from);
        Self::new(re, f64::read(from))
    }
}
