//! Sends PC_INFO to many numbers at once and collects the result for each number.
use std::collections::{BTreeMap, BTreeSet};

use crate::master::engine::{Link, Received};
use crate::master::error::ExchangeError;
use crate::master::procedures::exchange::{Answer, InfoCollector, TRIES, identity};
use crate::master::reports::BoardSeen;
use ucom::{BoardInfo, FromBoard, Function, Sequence, Status, ToBoard};

/// Time between two PC_INFO requests of a round in µs. Because of this pause, the answers of 31 boards do not arrive as one burst.
const SPACING: u64 = 2_000;

/// Answers to the PC_INFO requests that were sent to one board number.
#[derive(Default)]
pub(crate) struct Slot {
    /// Answers so far, which may differ in flash number, Program ID or date.
    pub answers: Vec<(BoardInfo, Option<String>)>,
    pub confirmed: bool,
    pub contradicts: bool,
    pub status: Option<&'static str>,
}

impl Slot {
    fn take(&mut self, number: u8, info: BoardInfo, text: Option<String>) {
        if info.sequence != number {
            self.contradicts = true;
            return;
        }
        if let Some(problem) = info.status.contradiction() {
            self.status = Some(problem);
            return;
        }
        self.confirmed |= self.answers.iter().any(|(old, _)| identity(old) == identity(&info));
        self.answers.push((info, text));
    }

    fn settled(&self) -> bool {
        self.confirmed && self.answers.iter().any(|(_, text)| text.is_some())
    }

    pub(crate) fn seen(&self, number: u8) -> Option<BoardSeen> {
        let (info, _) = self.answers.last()?;
        // Uses the latest answer whose identity agrees with the identity of another answer.
        let agreed =
            |i: &BoardInfo| self.answers.iter().filter(|(o, _)| identity(o) == identity(i)).count() > 1;
        let info = self.answers.iter().rev().map(|(i, _)| i).find(|i| agreed(i)).unwrap_or(info);
        let texts = self.answers.iter().filter(|(i, _)| identity(i) == identity(info));
        let description = texts.filter_map(|(_, text)| text.clone()).next_back();
        Some(BoardSeen { number, info: *info, description })
    }
}

/// Sends PC_INFO to all given numbers in at most four rounds. A number gets further requests until its board has sent
/// a complete description and two answers that agree, or has been silent three times.
pub(crate) async fn ask_all(link: &Link, numbers: &[Sequence]) -> BTreeMap<u8, Slot> {
    let mask = numbers.iter().fold(0, |mask, n| mask | 1 << n.number());
    let times = link.times();
    let mut slots: BTreeMap<u8, Slot> = BTreeMap::new();
    for round in 0..=TRIES {
        let open: Vec<Sequence> = numbers
            .iter()
            .copied()
            .filter(|n| match slots.get(&n.number()) {
                None => round < TRIES,
                Some(slot) => !slot.settled(),
            })
            .collect();
        if open.is_empty() {
            break;
        }
        link.listen(mask, &[Function::DspInfo]);
        let mut collectors: BTreeMap<u8, InfoCollector> = BTreeMap::new();
        for number in open {
            link.send(number, ToBoard::Info).await;
            let until = link.now() + SPACING;
            while let Some(received) = link.next(until).await {
                collect(link, &mut collectors, &received);
            }
        }
        let mut until = link.now() + times.info;
        let limit = until + 20 * times.gap;
        while let Some(received) = link.next(until).await {
            collect(link, &mut collectors, &received);
            until = (link.now() + times.gap).min(limit);
            if link.now() >= limit {
                break;
            }
        }
        for (number, collector) in collectors {
            if let Answer::Info(info, text) = collector.answer() {
                slots.entry(number).or_default().take(number, info, text);
            }
        }
    }
    slots
}

fn collect(link: &Link, collectors: &mut BTreeMap<u8, InfoCollector>, received: &Received) {
    if let FromBoard::Info(payload) = received.message {
        let collector = collectors.entry(received.from).or_default();
        // If this frame is not a first frame, the collector stays empty, and the next round sends PC_INFO to the number again.
        let _ = collector.push(received.at, &payload, link);
    }
}

/// Returns the last status of the boards with these numbers, or an error if the answers of a board contradict each other.
pub(crate) async fn statuses(
    link: &Link,
    numbers: &[Sequence],
) -> BTreeMap<u8, Result<Status, ExchangeError>> {
    let slots = ask_all(link, numbers).await;
    let status = |(board, slot): (u8, Slot)| {
        let contradiction = ExchangeError::Contradiction { board, tries: TRIES + 1 };
        match slot.answers.last() {
            Some((info, _)) if !slot.contradicts => (board, Ok(info.status)),
            _ => (board, Err(contradiction)),
        }
    };
    slots.into_iter().map(status).collect()
}

/// Returns the status of every board that answers. All boards get PC_INFO at the same time, and twice, because a frame can be lost. A board
/// that sends sensor outputs is considered to be running, even if its status shows another state.
pub(crate) async fn board_states(link: &Link) -> BTreeMap<u8, Status> {
    let numbers: Vec<Sequence> = link.profile().board_numbers().collect();
    let mask = numbers.iter().fold(0, |mask, n| mask | 1 << n.number());
    link.listen(mask, &[Function::DspInfo, Function::So]);
    let mut states: BTreeMap<u8, Status> = BTreeMap::new();
    let mut outputs = BTreeSet::new();
    let asked = link.profile().broadcast_number().map_or(numbers, |broadcast| vec![broadcast]);
    for _ in 0..2 {
        let mut collectors: BTreeMap<u8, InfoCollector> = BTreeMap::new();
        for number in &asked {
            link.send(*number, ToBoard::Info).await;
        }
        let times = link.times();
        let until = link.now() + times.info.max(3 * times.so) + times.gap;
        while let Some(received) = link.next(until).await {
            match received.message {
                FromBoard::So(_) => {
                    outputs.insert(received.from);
                }
                FromBoard::Info(payload) => {
                    let collector = collectors.entry(received.from).or_default();
                    let _ = collector.push(received.at, &payload, link);
                }
                _ => {}
            }
            if link.now() >= until {
                break;
            }
        }
        for (number, collector) in collectors {
            if let Answer::Info(info, _) = collector.answer()
                && info.sequence == number
                && info.status.contradiction().is_none()
            {
                states.insert(number, info.status);
            }
        }
    }
    for number in outputs {
        let status = states.entry(number).or_default();
        *status = status.with(Status::MCARUN, true);
    }
    states
}
