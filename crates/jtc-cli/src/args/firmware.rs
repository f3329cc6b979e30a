//! `jtc firmware`: options for images, USB drives, and the firmware of a board.

use std::path::PathBuf;

use clap::{Args, Subcommand};

use super::LinkArgs;

/// `jtc firmware …`
#[derive(Debug, Subcommand)]
pub(crate) enum FirmwareCommand {
    /// List installed images and mounted board drives
    #[command(after_help = "The file firmware.json lists the installed images. The environment variable \
            OPENJTC_FIRMWARE sets the folder of this file. Without this variable, the command first searches \
            ../share/openjtc/firmware, relative to the directory of this program. Then it searches \
            /usr/share/openjtc/firmware.\n\n\
            Examples:\n  \
            jtc firmware list\n  \
            jtc --json firmware list | jq -r .drives[].path")]
    List,
    /// Flash a Nucleo board through its ST-LINK drive, and verify
    #[command(after_help = "Flashing resets the board. If the board holds an arm, the arm falls.\n\n\
            The board's own port is the serial port of the USB device that has the ST-LINK drive. The \
            command can find this port only on Linux. Before flashing, the command asks the controller at \
            the board's own port for its state. With --port, the command also asks the controller at the \
            port of this option. The command refuses to flash (exit code 4) if the board's own port cannot \
            be used. The command also refuses if the port of --port is in use, or if a controller reports torque. No \
            option overrides these checks.\n\n\
            On a terminal, the command asks for confirmation before flashing. The command does not ask if the \
            controller at the board's own port reports zero torque, answers of all joints, and a gripper \
            that is off. With --yes, the command never asks.\n\n\
            The processor core of some boards can have one of two supplies (SMPS or LDO). Do not flash an \
            image for the other supply. The command knows the supply only if the controller at the board's \
            own port reports the board of the image. Otherwise, such a board needs --accept-supply.\n\n\
            After flashing, the command asks the controller which firmware runs. The firmware reports the \
            CRC-32 of its flash memory, and the command compares this CRC-32 with the image. --baud sets the \
            rate before flashing. After flashing, the command uses the rate of the image.\n\n\
            Flashing can delete the stored arm. Save the arm first with `jtc arm pull -o FILE`.\n\n\
            Examples:\n  \
            jtc firmware flash\n  \
            jtc firmware flash --board nucleo-h745zi-q --accept-supply\n  \
            jtc firmware flash --image openjtc.elf --drive /media/me/NOD_H743ZI2 --port /dev/ttyUSB0\n  \
            jtc firmware flash --image openjtc.bin --no-read-back --yes")]
    Flash(FlashArgs),
    /// Verify that a board runs an image; nothing is written
    #[command(
        after_help = "Without --image or --board, the command uses the image of the board that the controller reports.\n\n\
            Examples:\n  \
            jtc firmware verify\n  \
            jtc firmware verify --image openjtc.bin --port /dev/ttyACM0"
    )]
    Verify {
        #[command(flatten)]
        image: ImageArgs,
        #[command(flatten)]
        link: LinkArgs,
    },
}

/// Options that select the image.
#[derive(Args, Clone, Debug)]
pub(crate) struct ImageArgs {
    /// Use this image, a binary (.bin) or an ELF file
    #[arg(long, value_name = "FILE", conflicts_with = "board")]
    pub image: Option<PathBuf>,
    /// Use the installed image of this board.
    ///
    /// Names are nucleo-h745zi-q, nucleo-h745zi-q-ldo and nucleo-h743zi2
    #[arg(long, value_name = "NAME")]
    pub board: Option<String>,
}

/// Options of `jtc firmware flash`.
#[derive(Args, Debug)]
pub(crate) struct FlashArgs {
    #[command(flatten)]
    pub image: ImageArgs,
    /// Use the board drive that is mounted at this directory.
    ///
    /// Default: the board drive that the command finds, if it finds only one
    #[arg(long, env = "JTC_DRIVE", value_name = "DIR")]
    pub drive: Option<PathBuf>,
    /// Do not ask, and confirm that flashing is safe.
    ///
    /// You confirm that a mechanical support holds the arm, that its drives are without power, and that the safety
    /// wires match the image
    #[arg(long)]
    pub yes: bool,
    /// Flash even if the drive does not show the type of the board.
    ///
    /// The command then assumes that the image matches the board
    #[arg(long)]
    pub assume_board: bool,
    /// Confirm that the solder bridges match the core supply.
    ///
    /// You confirm that the solder bridges of the board match the core supply of the image
    #[arg(long)]
    pub accept_supply: bool,
    /// Flash even if the board already runs this image
    #[arg(long)]
    pub again: bool,
    /// Skip the verification after flashing.
    ///
    /// The command then does not ask the controller which image it runs
    #[arg(long)]
    pub no_read_back: bool,
    /// Set the timeout after flashing, s (1 to 3600).
    ///
    /// The command waits for this time until the board runs the image
    #[arg(long, env = "JTC_WAIT", value_name = "S", default_value_t = 120, value_parser = clap::value_parser!(u64).range(1..=3600))]
    pub wait: u64,
    #[command(flatten)]
    pub link: LinkArgs,
}
