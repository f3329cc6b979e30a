//! Sets supply and clocks to the values of [`openjtc_firmware::clock`]. The steps have the same order as in the HAL.
use embassy_stm32::interrupt::Priority;
use embassy_stm32::rcc::{
    AHBPrescaler, APBPrescaler, Hse, HseMode, LsConfig, Pll, PllDiv, PllMul, PllPreDiv, PllSource, Sysclk,
    VoltageScale, mux,
};
use embassy_stm32::time::Hertz;
use embassy_stm32::{Config, Peripherals};
use openjtc_firmware::clock;

/// Priority of every interrupt except the tick.
pub const LOW: Priority = Priority::P8;

/// Returns the HAL settings for output P or Q of a phase-locked loop.
fn pll(from: clock::Pll, p: bool) -> Pll {
    // The registers contain the multiplier minus one and the divider minus one.
    let divide = PllDiv::from_bits((from.divide - 1) as u8);
    Pll {
        source: PllSource::HSE,
        prediv: PllPreDiv::from_bits(from.m as u8),
        mul: PllMul::from_bits((from.n - 1) as u16),
        #[cfg(feature = "nucleo-h743zi2")]
        fracn: None,
        divp: p.then_some(divide),
        divq: (!p).then_some(divide),
        divr: None,
    }
}

/// Starts the power supply, the clocks and the HAL.
pub fn init() -> Peripherals {
    let mut config = Config::default();
    // Without this setting, the DMA interrupts would have the priority of the tick.
    config.dma_interrupt_priority = LOW;
    config.bdma_interrupt_priority = LOW;
    config.mdma_interrupt_priority = LOW;

    let rcc = &mut config.rcc;
    rcc.hsi48 = None;
    rcc.ls = LsConfig::off();
    rcc.hse = Some(Hse { freq: Hertz(clock::HSE_HZ), mode: HseMode::Bypass });
    rcc.pll1 = Some(pll(clock::CORE, true));
    rcc.pll2 = Some(pll(clock::CAN, false));
    rcc.pll3 = Some(pll(clock::SERIAL, false));
    rcc.sys = Sysclk::PLL1_P;
    rcc.ahb_pre = AHBPrescaler::DIV2;
    rcc.apb1_pre = APBPrescaler::DIV2;
    rcc.apb2_pre = APBPrescaler::DIV2;
    rcc.apb3_pre = APBPrescaler::DIV2;
    rcc.apb4_pre = APBPrescaler::DIV2;
    rcc.mux.fdcansel = mux::Fdcansel::PLL2_Q;
    rcc.mux.usart234578sel = mux::Usart234578sel::PLL3_Q;
    rcc.voltage_scale = if clock::SMPS { VoltageScale::Scale1 } else { VoltageScale::Scale0 };

    #[cfg(not(feature = "nucleo-h743zi2"))]
    {
        use core::mem::MaybeUninit;
        use embassy_stm32::SharedData;
        use embassy_stm32::rcc::SupplyConfig;

        /// Memory in which the HAL passes the clock settings to a program on the Cortex-M4. No program reads this
        /// memory.
        #[unsafe(link_section = ".sram4")]
        static SHARED: MaybeUninit<SharedData> = MaybeUninit::uninit();

        // Only the first write of the supply configuration after power-on has an effect. A wrong value makes the board
        // unreachable (docs/board.md).
        config.rcc.supply_config = if clock::SMPS { SupplyConfig::DirectSMPS } else { SupplyConfig::LDO };
        embassy_stm32::init_primary(config, &SHARED)
    }
    #[cfg(feature = "nucleo-h743zi2")]
    embassy_stm32::init(config)
}
