//! Tests of the actions that store an image (J-54).
use super::*;

/// An image of 40 bytes needs two words. The actions are the erasure, two words of the image, and the header.
#[test]
fn j54_an_image_is_recorded_only_after_its_header_is_programmed() {
    let image = [7; 40];
    let mut slots = Slots::default();
    let mut storing = Storing::begin(&mut slots, &image).expect("the image fits");
    for action in 0..4 {
        assert_ne!(storing.action(&image), Action::Stored, "{action}");
        storing.finish(&mut slots);
        assert_eq!(slots.current(), None, "{action} actions are completed");
        storing.done();
    }
    assert_eq!(storing.action(&image), Action::Stored);
    storing.finish(&mut slots);
    assert_eq!(slots.current(), Some((0, 1)));
}
