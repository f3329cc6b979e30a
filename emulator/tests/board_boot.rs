//! Start of a board after power-on: supply, clocks, statuses, version record and second core.
mod rig;

use jtc_core::ControllerState;
use jtc_wire::fixed;
use openjtc_emulator::BoardConfig;
use openjtc_emulator::clock::{MICROSECOND, MILLISECOND};
use openjtc_emulator::observe::ResetCause;
use rig::{BOARDS, PORTS, Rig, elf, index, program, version};

/// Returns `true` for the boards with a Cortex-M4.
fn two_cores(board: &str) -> bool {
    board.contains("h745")
}

/// Returns `true` for the board that generates its core voltage with the SMPS.
fn smps(board: &str) -> bool {
    board == "nucleo-h745zi-q"
}

#[test]
fn j10_clocks_are_those_of_the_documents() {
    for board in BOARDS {
        let mut rig = Rig::new(board);
        rig.run(10);
        let clocks = rig.board.machine.chip().rcc.clocks();
        let core = if smps(board) { 400_000_000 } else { 480_000_000 };
        assert_eq!((clocks.core, clocks.hclk, clocks.pclk1), (core, core / 2, core / 4), "{board}");
        assert_eq!((clocks.fdcan, clocks.usart), (85_000_000, 120_000_000), "{board}");
    }
}

/// RM0399 and RM0433: PWR_CR3 contains LDOEN in bit 1 and SDEN in bit 2. The value 0b11 of D3CR.VOS is scale 1.
/// SYSCFG_PWRCR.ODEN raises the voltage from scale 1 to scale 0, which is permitted only with the LDO.
#[test]
fn supply_and_voltage_are_those_of_the_board() {
    for board in BOARDS {
        let mut rig = Rig::new(board);
        rig.run(10);
        let (cr3, vos) = rig.board.machine.chip().supply();
        let overdrive = rig.register(0x5800_042C) & 1;
        let ldo = cr3 >> 1 & 1 == 1;
        assert_eq!((ldo, vos), (!smps(board), 0b11), "{board}: CR3 {cr3:#x}");
        assert_eq!(overdrive == 1, ldo, "{board}: overdrive needs the LDO, 480 MHz needs overdrive");
        if two_cores(board) {
            assert_eq!(cr3 >> 2 & 1 == 1, smps(board), "{board}: CR3 {cr3:#x}");
        }
    }
}

#[test]
fn j12_tim7_ticks_a_thousand_times_a_second() {
    const TIM7: u32 = 0x4000_1400;
    for board in BOARDS {
        let mut rig = Rig::new(board);
        rig.run(100);
        let clock = rig.board.machine.chip().rcc.clocks().timers;
        let (prescaler, reload) = (rig.register(TIM7 + 0x28) + 1, rig.register(TIM7 + 0x2C) + 1);
        assert_eq!(clock, u64::from(prescaler) * u64::from(reload) * 1000, "{board}");
        assert_eq!(
            (rig.register(TIM7) & 1, rig.register(TIM7 + 0x0C) & 1),
            (1, 1),
            "{board}: runs, interrupts"
        );
        let before = rig.ticks;
        assert!(before >= 95, "{board}: the first tick came late, {before} in 100 ms");
        rig.run(1000);
        assert_eq!(rig.ticks - before, 1000, "{board}");
    }
}

/// Memory that DMA and the core share is not cached, and an access through a null pointer causes a fault. In the
/// register RASR, XN is bit 28, AP is bits 26..24, TEX S C B are bits 21..16, and the size is bits 5..1 (ARMv7-M
/// B3.5.9).
#[test]
fn memory_is_protected_and_shared_memory_is_not_cached() {
    for board in BOARDS {
        let mut rig = Rig::new(board);
        rig.run(20);
        assert_eq!(rig.register(0xE000_ED94) & 1, 1, "{board}: MPU_CTRL");
        assert_eq!(rig.register(0xE000_ED14) >> 16 & 3, 3, "{board}: both caches");
        let regions = *rig.board.machine.chip().scs.mpu_regions();
        // If several MPU regions contain an address, the region with the highest number applies.
        let at = |address: u32| {
            let holds = |(rbar, rasr): &(u32, u32)| {
                let size = 1u64 << ((rasr >> 1 & 31) + 1);
                let start = u64::from(*rbar & !31);
                rasr & 1 == 1 && (start..start + size).contains(&u64::from(address))
            };
            regions.iter().rev().find(|region| holds(region)).map(|(_, rasr)| *rasr)
        };
        assert_eq!(at(0).map(|rasr| rasr >> 24 & 7), Some(0), "{board}: no access at 0");
        for shared in [0x3000_0000, 0x3001_FFFC] {
            let rasr = at(shared).unwrap_or_else(|| panic!("{board}: no region at {shared:#x}"));
            assert_eq!((rasr >> 19 & 7, rasr >> 16 & 3), (1, 0), "{board}: normal, not cached: {rasr:#x}");
            assert_eq!((rasr >> 24 & 7, rasr >> 28 & 1), (3, 1), "{board}: data of anybody: {rasr:#x}");
        }
    }
}

/// J-12: no other interrupt has the same priority as the tick, so only critical sections can delay the tick.
#[test]
fn j12_the_tick_is_above_all_other_interrupts() {
    const ENABLED: u32 = 0xE000_E100;
    const PRIORITIES: u32 = 0xE000_E400;
    for board in BOARDS {
        let mut rig = Rig::new(board);
        rig.run(20);
        let enabled: Vec<u32> =
            (0..150).filter(|n| rig.register(ENABLED + n / 32 * 4) >> (n % 32) & 1 == 1).collect();
        assert!(enabled.contains(&55), "{board}: {enabled:?}");
        for line in enabled {
            let priority = rig.register(PRIORITIES + line / 4 * 4) >> (8 * (line % 4)) & 0xFF;
            assert_eq!(priority == 0, line == 55, "{board}: interrupt {line} has priority {priority:#x}");
        }
    }
}

/// J-01: both serial lines use eight data bits, no parity, one stop bit and no flow control.
#[test]
fn j01_both_lines_are_8n1() {
    for board in BOARDS {
        let mut rig = Rig::new(board);
        rig.run(20);
        for usart in [0x4000_4400, 0x4000_4800] {
            let (cr1, cr2, cr3) = (rig.register(usart), rig.register(usart + 4), rig.register(usart + 8));
            assert_eq!(cr1 & (1 << 28 | 1 << 12 | 1 << 10), 0, "{board}: M1, M0, PCE in {cr1:#x}");
            assert_eq!(cr2 & 3 << 12, 0, "{board}: STOP in {cr2:#x}");
            assert_eq!(cr3 & 3 << 8, 0, "{board}: CTSE, RTSE in {cr3:#x}");
            assert_eq!(cr3 & 3 << 6, 3 << 6, "{board}: DMAT, DMAR in {cr3:#x}");
        }
    }
}

#[test]
fn j04_a_status_on_both_ports_every_40_ms() {
    for board in BOARDS {
        let mut rig = Rig::new(board);
        rig.run(1000);
        for port in PORTS {
            let host = &rig.hosts[index(port)];
            let counters = host.counters();
            assert_eq!((counters.bad_frames, counters.skipped_bytes), (0, 0), "{board}: CRC");
            assert!(counters.frames >= 23, "{board}: {counters:?}");
            for pair in host.times.windows(2) {
                let off = (pair[1] - pair[0]).abs_diff(40 * MILLISECOND);
                assert!(off < 100 * MICROSECOND, "{board}: {pair:?}");
            }
            let status = rig.status(port);
            assert_eq!(
                (status.state, status.errors, status.occurred),
                (ControllerState::Init.into(), 0, 0),
                "{board}: Init without errors"
            );
            assert_eq!((status.jtc_init, status.node_init), (7, 0), "{board}: parameters are awaited");
        }
    }
}

#[test]
fn nothing_unexpected_is_touched() {
    for board in BOARDS {
        let mut rig = Rig::new(board);
        rig.run(500);
        let chip = rig.board.machine.chip();
        assert!(chip.unknown.is_empty(), "{board}: {:x?}", chip.unknown);
        assert!(chip.unclocked.is_empty(), "{board}: {:x?}", chip.unclocked);
        assert!(chip.observers.faults.is_empty(), "{board}: {:?}", chip.observers.faults);
        let causes: Vec<_> = chip.observers.resets.iter().map(|r| r.cause).collect();
        assert_eq!(causes, [ResetCause::PowerOn], "{board}");
        assert_eq!(rig.flight.cause, 1, "{board}: power-on");
    }
}

#[test]
fn the_version_record_says_what_this_is() {
    for board in BOARDS {
        let version = version(&elf(board)).unwrap_or_else(|| panic!("{board}: no record"));
        assert_eq!(version.board, board);
        assert_eq!((version.points, version.segments, version.segment_points), (12_000, 100, 1_500));
        assert_eq!((version.tick_hz, version.baud), (1000, 115_200));
        let mut rig = Rig::new(board);
        rig.run(10);
        let clocks = rig.board.machine.chip().rcc.clocks();
        assert_eq!(clocks.core, u64::from(version.core_hz), "{board}");
        assert_eq!(
            rig.board.machine.chip().usarts.each_ref().map(|u| u.baud() / 1000),
            [115, 115],
            "{board}"
        );
    }
}

#[test]
fn j67_the_program_reports_what_is_in_its_flash() {
    for board in BOARDS {
        let mut rig = Rig::new(board);
        rig.run(500);
        rig.ask(PORTS[0], &fixed::GET_INFO);
        rig.run(50);
        let info = rig.hosts[index(PORTS[0])].info.expect("an Info");
        assert_eq!(info.program, Some(program(&elf(board))), "{board}");
    }
}

#[test]
fn the_second_core_is_parked_where_there_is_one() {
    const BANK2: u32 = 0x0810_0000;
    for board in BOARDS {
        let mut rig = Rig::new(board);
        let words: Vec<_> = (0..18).map(|n| rig.register(BANK2 + 4 * n)).collect();
        if !two_cores(board) {
            assert!(words.iter().all(|w| *w == u32::MAX), "{board}: {words:x?}");
            continue;
        }
        assert!((0x3000_0000..=0x3004_8000).contains(&words[0]), "{board}: stack at {:#x}", words[0]);
        for vector in &words[1..16] {
            assert_eq!(*vector, BANK2 + 64 + 1, "{board}: every vector leads to the sleep");
        }
        // The program of the second core is WFI and a branch back to WFI.
        assert_eq!(words[16], 0xE7FD_BF30, "{board}");
    }
}

/// The firmware behaves the same for any RAM contents at power-on, because it writes each memory location before it
/// reads it.
#[test]
fn what_memory_holds_at_power_on_does_not_matter() {
    let run = |seed| {
        let mut rig = Rig::with(BOARDS[0], BoardConfig { seed, ..Default::default() });
        let mut frames = Vec::new();
        for _ in 0..300 {
            rig.step();
            frames.extend(rig.bus.iter().map(|entry| (entry.start, entry.frame)));
        }
        (frames, rig.hosts.map(|host| (host.times, host.last)), rig.flight)
    };
    let first = run(1);
    for seed in [2, 3, 0xFFFF_FFFF] {
        assert!(run(seed) == first, "another run with seed {seed}");
    }
}
