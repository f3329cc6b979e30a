//! `jtc firmware`: options for images, USB drives, and the firmware of a board.

use std::path::PathBuf;

use clap::{Args, Subcommand};

use super::LinkArgs;

/// `jtc firmware …`
#[derive(Debug, Subcommand)]
pub(crate) enum FirmwareCommand {
    /// List installed images and mounted board drives
    #[command(
        after_help = "The file firmware.json lists the images. The environment variable OPENJTC_FIRMWARE \
            names the folder of this file. Without this variable, the folder is ../share/openjtc/firmware, \
            relative to the directory of this program. If this folder does not contain firmware.json, the \
            folder is /usr/share/openjtc/firmware.\n\n\
            Examples:\n  \
            jtc firmware list\n  \
            jtc --json firmware list | jq -r .drives[].path"
    )]
    List,
    /// Flash a Nucleo board through its ST-LINK drive, and verify
    #[command(after_help = "Flashing resets the board. An arm that the board holds then falls.\n\n\
            Before flashing, the command always asks the controller at the board's own port for its state. \
            With --port, the command also asks the controller at that port. The board's own port is the \
            serial port of the USB device that has the drive. The command knows this port only on Linux. The \
            command ends with exit code 4 if the board's own port cannot be used, if the port of --port is \
            in use, or if a controller reports torque. No option overrides these checks.\n\n\
            The command flashes without a question only under three conditions. The controller at the \
            board's own port reports no torque, every joint answers this controller, and the gripper is off. \
            Otherwise, the command asks for confirmation on a terminal. With --yes, the command does not \
            ask.\n\n\
            If the controller at the board's own port reports exactly the board of the image, the command \
            knows the core supply of the board. Otherwise, a board that exists with both core supplies needs \
            --accept-supply.\n\n\
            After flashing, the command asks the controller at the same port which firmware runs. The \
            firmware reports the CRC-32 of its own flash, and the command compares this CRC-32 with the \
            image. --baud is the rate before flashing. After flashing, the command uses the rate of the \
            image.\n\n\
            Flashing can delete the stored arm: save it first with `jtc arm pull -o FILE`.\n\n\
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
    /// You confirm that the arm is supported, that its drives have no power, and that the safety wires match the image
    #[arg(long)]
    pub yes: bool,
    /// Assume the board of the image if the drive names no board
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
    /// Do not ask the controller afterwards which image it runs.
    ///
    /// The command then cannot verify that the board runs the image
    #[arg(long)]
    pub no_read_back: bool,
    /// Set the longest wait for the image, s (1 to 3600).
    ///
    /// The command waits until the board runs the image
    #[arg(long, env = "JTC_WAIT", value_name = "S", default_value_t = 120, value_parser = clap::value_parser!(u64).range(1..=3600))]
    pub wait: u64,
    #[command(flatten)]
    pub link: LinkArgs,
}
