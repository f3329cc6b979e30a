//! Tests of a session on a shared line. The session must distinguish rejections by the device from denials by the agent.

use std::cell::RefCell;
use std::rc::Rc;
use std::time::Duration;

use jtc_host::port::test::ScriptedPort;
use jtc_host::session::Flow;
use jtc_host::{
    Arm, CheckOptions, CheckedTrajectory, Error, LinkError, Port, PortError, Session, UploadError,
};
use jtc_wire::{DataStatus, FrameStatus, Response, Status};

/// Denial that is delivered together with the next bytes that the session reads. The denial may belong to the last
/// frame or to an earlier frame.
#[derive(Clone, Default)]
struct Denials(Rc<RefCell<Option<&'static str>>>);

/// Shared line on which every frame is rejected.
struct SharedLine<P> {
    port: P,
    arriving: Denials,
    denied: Option<String>,
}

impl<P: Port> Port for SharedLine<P> {
    fn read(&mut self, buffer: &mut [u8], timeout: Duration) -> Result<usize, PortError> {
        let n = self.port.read(buffer, timeout)?;
        self.denied = self.arriving.0.take().map(str::to_owned).or(self.denied.take());
        Ok(n)
    }
    fn write_all(&mut self, bytes: &[u8]) -> Result<(), PortError> {
        self.port.write_all(bytes)
    }
    fn now(&self) -> Duration {
        self.port.now()
    }
    fn baud(&self) -> Option<u32> {
        self.port.baud()
    }
    fn take_denial(&mut self) -> Option<String> {
        self.denied.take()
    }
}

/// Returns a session on a shared line on which every frame is rejected: by the agent with the reason `own`, or by the
/// device if `own` is `None`.
fn session(own: Option<&'static str>) -> (Session<impl Port>, Denials) {
    let arriving = Denials::default();
    let denials = arriving.clone();
    let device = ScriptedPort::new(None, move |_, bytes: &[u8]| {
        let &[_, frame_type, ..] = bytes else { return Vec::new() };
        if let Some(reason) = own {
            denials.0.replace(Some(reason));
        }
        let (status, data) = (FrameStatus::NoError, DataStatus::NotAllowed);
        let response = Response { frame_type, status, data, length: bytes.len() as u16 };
        Status { response, ..Status::default() }.emit().to_vec()
    });
    (Session::new(SharedLine { port: device, arriving: arriving.clone(), denied: None }), arriving)
}

/// A denial that arrives late belongs to an earlier frame. This denial must not be used as the reason for the rejection
/// of the next frame.
#[test]
fn a_late_denial_is_not_that_of_the_next_frame() {
    let (mut s, arriving) = session(None);
    let refused = |error: LinkError| assert!(matches!(error, LinkError::Refused { .. }), "{error}");
    refused(s.gripper(true).unwrap_err());
    arriving.0.replace(Some("of a frame before"));
    refused(s.gripper(true).unwrap_err());
    arriving.0.replace(Some("of a frame before"));
    let options = CheckOptions::default();
    let checked =
        CheckedTrajectory::check(&super::motion(0.1, 50.0), &Arm::avena(), &[0.0; 6], &options).unwrap();
    let error = s.upload(&checked, |_| Flow::Continue).unwrap_err();
    assert!(matches!(error, Error::Upload(UploadError::SegmentRefused { segment: 0, .. })), "{error}");
}

/// A denial that arrives together with a rejection is the reason for this rejection.
#[test]
fn a_denial_is_that_of_the_frame_before_it() {
    let (mut s, _) = session(Some("another one commands"));
    let error = s.gripper(true).unwrap_err();
    assert!(
        matches!(&error, LinkError::Denied { reason, .. } if reason == "another one commands"),
        "{error}"
    );
}
