//! Functions that load, read back, hash and store the complete arm (J-52, J-54).
use jtc_wire::{Answer, ArmImage, DataStatus, FrictionImage, Hash, PAGE_BYTES, RawPoint, StoreState};

use super::Extensions;
use super::image::ImageSource;
use crate::Config;
use crate::controller::Controller;
use crate::host::slices::{SliceOutcome, SliceProgress};
use crate::host_parameters::HostParameters;
use crate::settings;

/// Number of bytes of an arm image that are hashed or written in one tick.
pub(super) const IMAGE_PER_TICK: usize = 256;

impl Extensions {
    /// Clears the hash of the arm, because the arm that the controller uses has changed.
    pub(crate) fn forget_hash(&mut self) {
        (self.hash, self.hashed) = (None, (0, Hash::new()));
    }
}

impl<M: AsRef<[RawPoint]> + AsMut<[RawPoint]>> Controller<M> {
    /// Loads the stored arm (J-54). The controller then uses the settings and the name of this arm, and the
    /// UseDefault frames refer to this arm. The host must still request the parameters. The board calls this function
    /// before the first tick. Returns `false` if this controller does not accept the image. The settings then do not
    /// change, and the controller refuses the UseDefault frames until an arm is stored.
    pub fn load_arm(&mut self, image: &[u8]) -> bool {
        let arm = ArmImage::parse(image);
        let config = arm.and_then(|arm| settings::with_values(&self.config, arm.settings.iter()).ok());
        // The values of the image are written directly into the parameters. A temporary copy of the parameters would need too much of the
        // small stack.
        let loaded = arm.zip(config).is_some_and(|(arm, config)| {
            let taken = takes(&mut self.parameters, &arm, &config);
            if taken {
                self.extensions.stored.set(image);
                self.extensions.name = arm.name;
                self.nodes.use_settings(&config, &self.config);
                self.config = config;
            }
            taken
        });
        if !loaded {
            self.parameters.begin(&self.config);
        }
        // The controller uses these parameters only when the host requests them.
        self.parameters.forget();
        self.extensions.forget_hash();
        self.extensions.unusable = !loaded;
        loaded
    }

    /// Returns the image of the stored arm. The board writes this image to its memory when [`crate::Outputs::store`] requests it. The image
    /// is empty if no arm is stored.
    pub fn stored_arm(&self) -> &[u8] {
        self.extensions.stored.bytes()
    }

    /// Sets the state of the storage and the number of the stored arm. The board calls this function when the state of the storage changes.
    pub fn set_store_state(&mut self, state: StoreState, sequence: u32) {
        let before = core::mem::replace(&mut self.extensions.store, state);
        self.extensions.sequence = sequence;
        if before == StoreState::Busy && state == StoreState::Failed {
            // The board could not write the arm, so its next start would use another arm. Therefore the controller
            // discards the stored arm. The controller has no stored arm until a host stores one again.
            self.extensions.stored.clear();
            self.extensions.unusable = true;
        }
    }

    fn image(&self) -> ImageSource<'_> {
        ImageSource { config: &self.config, parameters: &self.parameters, name: &self.extensions.name }
    }

    /// Computes the next part of the hash of the arm, unless the hash is already known.
    pub(crate) fn hash_arm(&mut self) {
        if self.extensions.hash.is_none() {
            self.hash_more();
        }
    }

    #[inline(never)]
    fn hash_more(&mut self) {
        let (offset, hash) = self.extensions.hashed;
        let (offset, hash) = self.image().hash(offset, hash, IMAGE_PER_TICK);
        self.extensions.hashed = (offset, hash);
        if self.image().hashed(offset) {
            self.extensions.hash = Some(hash.value());
        }
    }

    pub(super) fn get_arm(&mut self, line: usize, offset: u16) {
        let mut bytes = [0; PAGE_BYTES];
        let (read, total) = (self.image().read(offset.into(), &mut bytes), self.image().len() as u16);
        let bytes = bytes.get(..read).unwrap_or(&[]);
        self.extensions.answers.put(line, &Answer::Arm { offset, total, bytes });
    }

    /// Stores the arm that the controller uses (J-54). First, this arm becomes the arm to which the UseDefault frames refer. Then the board
    /// writes this arm to its memory.
    pub(super) fn store_arm(&mut self) -> SliceOutcome {
        let offset = match self.slice_progress {
            SliceProgress::Image(offset) => offset,
            _ if !self.settable()
                || !self.parameters.all_given()
                || matches!(self.extensions.store, StoreState::Absent | StoreState::Busy) =>
            {
                return SliceOutcome::Refused(DataStatus::NotAllowed);
            }
            // The gains and the model may come from different times. Therefore the controller checks again that the
            // gains match the inertia of this model (J-71).
            _ if !self.parameters.gains_are_borne(&self.config) => {
                return SliceOutcome::Refused(DataStatus::IncorrectValue);
            }
            _ => 0,
        };
        let Self { extensions, config, parameters, .. } = self;
        let source = ImageSource { config, parameters, name: &extensions.name };
        let next = extensions.stored.write(&source, offset, IMAGE_PER_TICK);
        if next < source.len() && next > offset {
            return SliceOutcome::Unfinished(SliceProgress::Image(next));
        }
        extensions.stored.finish(source.len());
        extensions.unusable = false;
        extensions.store = StoreState::Busy;
        extensions.store_requested = true;
        SliceOutcome::Done
    }
}

/// Applies the gains, model and friction of an arm. Returns `false` if these parameters are not valid with the settings.
fn takes(parameters: &mut HostParameters, arm: &ArmImage<'_>, config: &Config) -> bool {
    let friction = match arm.friction {
        FrictionImage::Polynomial(floats) => parameters.take_polynomial(&floats, config).is_ok(),
        FrictionImage::Table(floats) => {
            let mut progress = SliceProgress::Begin;
            // A complete friction table needs twelve slices.
            (0..16).any(|_| match parameters.take_table(&floats, progress, config) {
                SliceOutcome::Unfinished(next) => {
                    progress = next;
                    false
                }
                outcome => matches!(outcome, SliceOutcome::Done),
            })
        }
    };
    friction && parameters.load(&arm.pid, &arm.model, config).is_ok()
}
