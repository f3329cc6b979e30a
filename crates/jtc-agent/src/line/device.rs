//! Controller side of the serial line: selects the next bytes to write, and the clients that receive each response
//! record.
use std::time::Duration;

use jtc_wire::{DataStatus, FrameRef, FrameStatus, FrameType, FromDevice, Response, Status};

use super::client::Client;
use super::frame_class::{FrameClass, HostFrame, returned_by};
use super::tx_queue::{Outgoing, Passed};
use super::{
    ClientId, Delivery, Denied, HALTS, LineEvent, OWNER, RECORD_TIME, RETURN_TIME, Return, Sent, SharedLine,
};

impl SharedLine {
    /// Returns the time at which [`to_device`](Self::to_device) must be called again, if no other event occurs
    /// before.
    pub fn due(&self, now: Duration) -> Option<Duration> {
        let waits = self.clients.values().any(|client| !client.waiting.is_empty());
        let line = match self.tx_queue.due(now) {
            None if waits => Some(self.returns.as_ref().map_or(now, |returns| returns.until)),
            due => due,
        };
        let lease = self.lease.as_ref().and_then(|lease| lease.until);
        // A command that is queued for the serial line must be written as soon as the line is free.
        let own = [self.halts.due(now), self.motion_tracker.due()].into_iter().flatten().min();
        let own = own.filter(|_| self.tx_queue.due(now).is_none());
        [line, lease, own].into_iter().flatten().min()
    }

    /// Returns the bytes to be written to the controller now.
    pub fn to_device(&mut self, now: Duration) -> Vec<u8> {
        self.end_lapsed(now);
        self.sent.retain(|sent| now < sent.at + RECORD_TIME);
        self.returns.take_if(|returns| now >= returns.until);
        if self.halts.look(now) {
            self.events.push_back(LineEvent::NotTaken);
        }
        let mut all = Vec::new();
        loop {
            self.tx_queue.set_urgent(self.halts.frame().map(|frame| Outgoing { client: HALTS, frame }));
            if self.tx_queue.is_free()
                && let Some(outgoing) = self.next_turn(now)
            {
                self.tx_queue.begin(outgoing);
            }
            let (bytes, passed) = self.tx_queue.next(now);
            let more = !bytes.is_empty();
            all.extend(bytes);
            for passed in passed {
                match passed {
                    Passed::Written(outgoing) => self.note_written(outgoing, false),
                    Passed::Abandoned(outgoing) => {
                        let stopped = self.stopped(outgoing.client);
                        self.refuse(outgoing.client, &outgoing.frame, stopped);
                        self.note_written(outgoing, true);
                    }
                }
            }
            if !more {
                return all;
            }
        }
    }

    /// Records that the operating system accepted the written bytes at time `now`.
    pub fn handed_over(&mut self, now: Duration) {
        self.tx_queue.handed_over(now);
    }

    /// Returns the next frame to be written. The frames of the clients are taken in rotation.
    fn next_turn(&mut self, now: Duration) -> Option<Outgoing> {
        if let Some(frame) = self.motion_tracker.frame(now) {
            return Some(Outgoing { client: OWNER, frame });
        }
        self.refuse_without_lease(now);
        let after = |id: &ClientId| *id > self.last_turn;
        let ids: Vec<ClientId> = self.clients.keys().copied().collect();
        let (first, then): (Vec<ClientId>, Vec<ClientId>) = ids.into_iter().partition(after);
        for id in first.into_iter().chain(then) {
            let Some(client) = self.clients.get_mut(&id) else { continue };
            let Some(frame) = client.waiting.front() else { continue };
            if frame.class == FrameClass::Ask
                && let Err(denied) = self.may_ask(id, now)
            {
                if let Some(frame) = self.clients.get_mut(&id).and_then(Client::take_waiting) {
                    self.refuse(id, &frame, denied);
                }
                continue;
            }
            let Some(client) = self.clients.get_mut(&id) else { continue };
            let Some(frame) = client.waiting.front() else { continue };
            // Frames that the controller returns do not contain the number of their request. The next request for a
            // frame of the controller therefore waits until the previous request is answered (J-50).
            let returns = frame.returns();
            if returns.is_some() && self.returns.is_some() {
                continue;
            }
            let frame = client.take_waiting()?;
            if let Some(kind) = returns {
                let until = self.tx_queue.free_at().max(now) + RECORD_TIME;
                self.returns = Some(Return { client: id, kind, until });
            }
            self.last_turn = id;
            return Some(Outgoing { client: id, frame });
        }
        None
    }

    /// Refuses queued frames of clients that have lost the lease. However, a client with the policy Continue takes
    /// the lapsed lease again if the lease is free.
    fn refuse_without_lease(&mut self, now: Duration) {
        let holder = self.lease.as_ref().map(|lease| lease.holder);
        let waits = |client: &Client| client.waiting.front().is_some_and(|frame| frame.class.needs_lease());
        let others = self.clients.iter().filter(|(id, client)| Some(**id) != holder && waits(client));
        let others: Vec<(ClientId, bool)> = others.map(|(id, client)| (*id, client.lapsed)).collect();
        for (id, lapsed) in others {
            if lapsed && self.may_command(id, now).is_ok() {
                continue;
            }
            while let Some(client) = self.clients.get_mut(&id)
                && waits(client)
                && let Some(frame) = client.take_waiting()
            {
                self.refuse(id, &frame, Denied::NotHolder);
            }
        }
    }

    pub(super) fn note_written(&mut self, outgoing: Outgoing, abandoned: bool) {
        let Outgoing { client, frame: HostFrame { frame_type, class, bytes } } = outgoing;
        let at = self.tx_queue.free_at();
        match class {
            FrameClass::Halt(_) => self.halts.written(at, self.tx_queue.baud()),
            FrameClass::Motion if !abandoned => {
                self.halts.motion_written();
                self.motion_tracker.begun(frame_type, at);
            }
            _ if frame_type == FrameType::SetSettings && !abandoned => self.supervision.note_written(&bytes),
            _ if frame_type == FrameType::Trajectory && !abandoned => self.motion_tracker.uploaded(at),
            _ if frame_type == FrameType::TeachingModeDisable && !abandoned => self.motion_tracker.taught(),
            _ => {}
        }
        if class != FrameClass::Ask && !abandoned {
            let client = if client == HALTS { OWNER } else { client };
            self.events.push_back(LineEvent::Sent { client, frame_type, class, bytes });
        }
        self.sent.push_back(Sent { client, kind: frame_type as u8, abandoned, at });
    }

    /// Processes bytes from the controller, in pieces of any length.
    pub fn from_device(&mut self, mut bytes: &[u8], now: Duration) {
        loop {
            match self.receiver.next_frame(&mut bytes) {
                None => return self.look_what_moves(now),
                Some(FromDevice::Status(status)) => {
                    let frame = self.receiver.frame_bytes().to_vec();
                    self.take_status(status, &frame, now);
                }
                Some(FromDevice::Answer(answer)) => {
                    self.supervision.take_answer(&answer);
                    let frame = self.receiver.frame_bytes().to_vec();
                    let kind = FrameRef::new_checked(&frame).map(|frame| frame.frame_type);
                    if let Some(Return { client, .. }) =
                        self.returns.take_if(|returns| Some(returns.kind) == kind)
                    {
                        self.deliver(client, Delivery::Bytes(frame));
                    }
                }
            }
        }
    }

    fn take_status(&mut self, status: Status, frame: &[u8], now: Duration) {
        self.status = Some((now, status));
        self.supervision.take_status(&status);
        let answered = status.response().map_or_else(Vec::new, |response| self.whose(response, now));
        for (client, response) in &answered {
            let taken = response.status == FrameStatus::NoError;
            if taken && response.frame_type == FrameType::SetSettings as u8 {
                self.supervision.take_record(response);
            }
            if taken
                && response.data != DataStatus::NoError
                && response.frame_type == FrameType::TeachingModeEnable as u8
            {
                // The controller has refused Teaching, so Teaching will not begin.
                self.motion_tracker.taught();
            }
            if *client == OWNER && taken && response.frame_type == FrameType::TeachingModeDisable as u8 {
                self.motion_tracker.answered();
            }
            if FrameType::from_byte(response.frame_type).is_some_and(|t| returned_by(t).is_none()) {
                self.events.push_back(LineEvent::Answered { client: *client, response: *response });
            }
        }
        let clients: Vec<ClientId> = self.clients.keys().copied().collect();
        for id in clients {
            let own = answered.iter().find(|(client, _)| *client == id).map(|(_, response)| *response);
            let refused = || self.clients.get_mut(&id).and_then(|client| client.take_refusal());
            let response = own.or_else(refused).unwrap_or(Response::NONE);
            let mut bytes = frame.to_vec();
            Status::replace_response(&mut bytes, &response);
            self.deliver(id, Delivery::Bytes(bytes));
        }
    }

    /// Returns the clients that receive a response record. The response record of a Stop goes to all clients that
    /// requested the Stop.
    fn whose(&mut self, response: Response, now: Duration) -> Vec<(ClientId, Response)> {
        let arrived = response.status == FrameStatus::NoError;
        // Response records arrive in the order of the frames. The record for a later frame therefore shows that the
        // missing records of earlier frames were lost or damaged.
        let at = self.sent.iter().position(|sent| {
            if arrived { !sent.abandoned && sent.kind == response.frame_type } else { sent.abandoned }
        });
        let Some(at) = at.or_else(|| (!arrived && !self.sent.is_empty()).then_some(0)) else {
            return Vec::new();
        };
        let Some(sent) = self.sent.drain(..=at).next_back() else { return Vec::new() };
        let returned = FrameType::from_byte(sent.kind).and_then(returned_by);
        if let Some(returns) =
            self.returns.as_mut().filter(|r| r.client == sent.client && Some(r.kind) == returned)
        {
            // The controller sends the requested frame after the response record, unless it refused the request.
            returns.until = if response.accepted() { now + RETURN_TIME } else { now };
        }
        if sent.client == HALTS {
            return self.halts.answered(&response, arrived);
        }
        if sent.abandoned { Vec::new() } else { vec![(sent.client, response)] }
    }
}
