//! Bus load: worst-case frame lengths, and a forecast of the load before boards are started (P-19).

use core::fmt;

use ucom::{Dimensions, Profile};

/// Returns the length of a classic frame in bits, including worst-case stuffing and the pause after the frame. The length is 55 bits for
/// DLC 0, 75 bits for DLC 2, and 135 bits for DLC 8.
pub const fn frame_bits(dlc: u8) -> u64 {
    let data = 8 * if dlc > 8 { 8 } else { dlc as u64 };
    // Stuff bits can occur in the data and in 34 of the 44 other bits of a frame. Three more bits separate two frames.
    let stuffed = 34 + data;
    44 + data + 3 + (stuffed - 1) / 4
}

/// Forecast of the bus load that the control loops of some boards will cause.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LoadForecast {
    /// Number of boards whose control loops will run.
    pub boards: u32,
    /// Bits per second that all boards and the PC will send.
    pub bits_per_s: u64,
    /// Bit rate in bit/s.
    pub bitrate: u32,
    /// Highest permitted bus load, `load.limit` of the profile, in percent.
    pub limit: u32,
}

impl LoadForecast {
    /// Creates a forecast for boards with the given buffer dimensions.
    pub fn new<'a>(dimensions: impl IntoIterator<Item = &'a Dimensions>, profile: &Profile) -> Self {
        let per_second = |period_ms: u32| 1000.0 / f64::from(period_ms.max(1));
        let full = frame_bits(8) as f64;
        let mut bits = 0.0;
        let mut boards = 0;
        for d in dimensions {
            boards += 1;
            bits += f64::from(d.so.div_ceil(3)) * full * per_second(profile.so_period);
            bits += f64::from(d.ci.div_ceil(3)) * full * per_second(profile.ci_period);
            bits += frame_bits(0) as f64 * per_second(profile.alive_dsp_period);
        }
        bits += frame_bits(0) as f64 * per_second(profile.alive_pc_period);
        Self { boards, bits_per_s: bits as u64, bitrate: profile.bitrate, limit: profile.load_limit }
    }

    /// Returns the forecast load as a percentage of the bit rate.
    pub fn percent(&self) -> f64 {
        100.0 * self.bits_per_s as f64 / f64::from(self.bitrate.max(1))
    }

    /// Returns `true` if the forecast load exceeds the limit.
    pub fn exceeds(&self) -> bool {
        self.percent() > f64::from(self.limit)
    }
}

impl fmt::Display for LoadForecast {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { boards, bitrate, limit, .. } = self;
        let percent = self.percent();
        write!(
            f,
            "bus load {percent:.0} % of {bitrate} bit/s with {} running, limit {limit} %",
            super::counted(*boards as usize, "board")
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Compares the frame lengths with the list in the requirements.
    #[test]
    fn worst_case_lengths() {
        assert_eq!([frame_bits(0), frame_bits(2), frame_bits(8)], [55, 75, 135]);
    }

    /// Compares forecasts for 7 and 16 boards, with periods of 10 ms and 1 ms, with the values in the requirements.
    #[test]
    fn p19_forecasts_of_the_requirements() {
        let forecast = |boards: usize, so: u16, ci: u16, period: u32| {
            let all = std::vec![Dimensions { ci, so, par: 0 }; boards];
            let profile = Profile { so_period: period, ci_period: period, ..Profile::default() };
            LoadForecast::new(&all, &profile)
        };
        for (boards, so, ci, period, percent) in [
            (7, 6, 3, 10, 85.0 / 3.0),
            (7, 12, 3, 10, 142.0 / 3.0),
            (16, 12, 3, 10, 108.0),
            (7, 12, 3, 1, 472.5),
        ] {
            let f = forecast(boards, so, ci, period);
            // The forecast includes the heartbeats, but the expected value does not. The heartbeats add less than 0.2
            // % to the bus load.
            assert!((f.percent() - percent).abs() < 0.3, "{f}");
            assert_eq!(f.exceeds(), percent > 70.0);
        }
    }
}
