//! Tests with two hosts on two lines that send different arms at the same time (J-04, J-50, J-53).
use std::collections::VecDeque;

use proptest::prelude::*;

use super::*;

/// Returns all frames of an arm with the parameters of this host. The controller needs many ticks to process a friction table.
fn arm(host: u8) -> Vec<Vec<u8>> {
    let number = f64::from(host) + 1.0;
    let mut gains = vec![0; 126];
    jtc_wire::pid_param(&mut gains, &[[100.0 * number, 1.0, 2.0, -3.0, 3.0]; JOINTS]).expect("it fits");
    let value = |setting, joint, value| SettingValue { setting, joint, value };
    let settings = |values: &[SettingValue]| settings_frame(values).expect("it fits");
    vec![
        settings(&[value(33, 0, number), value(8, 1 + host, 1.0 + 0.1 * number)]),
        settings(&[value(50, 0, 100.0 * number), value(3, 6, 0.5 * number)]),
        fixed::set_name(&Name::cut(["left", "right"][usize::from(host)])).to_vec(),
        gains,
        if host == 0 { fixed::FRICTION_TABLE_USE_DEFAULT } else { fixed::FRICTION_POLYNOMIAL_USE_DEFAULT }
            .to_vec(),
        settings(&[value(103, 0, 2.0 * number)]),
        fixed::ARM_MODEL_USE_DEFAULT.to_vec(),
        fixed::GET_INFO.to_vec(),
    ]
}

proptest! {
    /// Two hosts send parameters at the same time. For each kind of parameter, the controller uses the last accepted
    /// frame of either host. The controller never mixes the values of two frames, although it may need many ticks for a
    /// frame. Each host receives the response records and answers to its own frames, in their order.
    #[test]
    fn j04_j53_two_hosts_with_different_arms_do_not_mix_within_a_frame(
        first in prop::collection::vec(any::<bool>(), 1..40),
        pauses in prop::collection::vec(0usize..4, 1..10),
    ) {
        let mut bench = Bench::new();
        let mut waiting = [0, 1].map(|host| VecDeque::from(arm(host)));
        let (mut order, mut first, mut pauses) = (Vec::new(), first.iter().cycle(), pauses.iter().cycle());
        while waiting.iter().any(|frames| !frames.is_empty()) {
            let mut lines = if *first.next().unwrap() { vec![0, 1] } else { vec![1, 0] };
            lines.retain(|line| !waiting[*line].is_empty());
            let frames: Vec<_> = lines.iter().map(|line| waiting[*line][0].clone()).collect();
            let host: Vec<_> = lines.iter().zip(&frames).map(|(line, bytes)| HostEvent {
                line: *line,
                overtaken: false,
                plain: false,
                event: LinkEvent::Frame(FrameRef::new_checked(bytes).expect("a good frame")),
            }).collect();
            let mut rest = &host[..];
            for _ in 0..100 {
                let done = bench.tick(rest).host_done;
                rest = &rest[done..];
                if rest.is_empty() {
                    break;
                }
            }
            prop_assert!(rest.is_empty(), "not carried out within 100 ticks");
            for line in lines {
                order.push((line, waiting[line].pop_front().unwrap()));
            }
            bench.run(*pauses.next().unwrap());
        }
        bench.run(100);

        for line in [0, 1] {
            let of_line = |records: &[(usize, Response)]| -> Vec<_> {
                records.iter().filter(|(at, _)| *at == line).map(|(_, record)| (record.frame_type, record.data)).collect()
            };
            let expected: Vec<_> = arm(line as u8).iter().map(|frame| (frame[1], DataStatus::NoError)).collect();
            prop_assert_eq!(of_line(&bench.records), expected, "line {}", line);
            prop_assert_eq!(bench.answers.iter().filter(|(at, _)| *at == line).count(), 1, "one Info");
        }
        bench.answers.clear();

        let mut alone = Bench::new();
        for (_, frame) in order.iter().filter(|(_, frame)| *frame != fixed::GET_INFO) {
            prop_assert_eq!(alone.send(0, frame), DataStatus::NoError);
        }
        prop_assert_eq!(bench.info(0).hash, alone.info(0).hash);
        prop_assert_eq!(bench.image(), alone.image());
    }
}
