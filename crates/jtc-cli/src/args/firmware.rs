//! `jtc firmware`: images, drives, and what a board runs.

use std::path::PathBuf;

use clap::{Args, Subcommand};

use super::LinkArgs;

/// `jtc firmware …`
#[derive(Debug, Subcommand)]
pub enum FirmwareCommand {
    /// The images that are installed, and the boards' drives that are mounted
    #[command(
        after_help = "Images are listed by firmware.json in the folder that OPENJTC_FIRMWARE names, else in\n\
                            ../share/openjtc/firmware beside this program, else in /usr/share/openjtc/firmware.\n\n\
                            Examples:\n  \
                            jtc firmware list\n  \
                            jtc --json firmware list | jq -r .drives[].path"
    )]
    List,
    /// Put an image onto a Nucleo board by the drive of its ST-LINK, and prove that it runs
    #[command(
        after_help = "The board is reset: an arm that it holds falls. The serial port of the drive's own USB device\n\
                            (known on Linux) is always asked, and --port beside it; a port that cannot be asked, and a\n\
                            controller that reports torque, end the command with 4, whatever options are given. Without a\n\
                            question a board is flashed only where its own port reports no torque, every joint answers it\n\
                            and the gripper is off; else this is asked on a terminal, --yes answers. How the core is\n\
                            supplied is known where that port reports the very board of the image; else a board that comes\n\
                            in both kinds needs --accept-supply. What runs afterwards is asked over the same port, and\n\
                            compared with the image by the CRC-32 of what the program finds in its own flash. --baud is the\n\
                            rate of what runs before; afterwards it is that of the image. The stored arm may be lost:\n\
                            `jtc arm pull -o FILE` before.\n\n\
                            Examples:\n  \
                            jtc firmware flash\n  \
                            jtc firmware flash --board nucleo-h745zi-q --accept-supply\n  \
                            jtc firmware flash --image openjtc.elf --drive /media/me/NOD_H743ZI2 --port /dev/ttyUSB0\n  \
                            jtc firmware flash --image openjtc.bin --no-read-back --yes"
    )]
    Flash(FlashArgs),
    /// Whether a board runs an image; nothing is written
    #[command(
        after_help = "Without --image or --board the image is that of the board which the controller reports.\n\n\
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

/// Which image.
#[derive(Args, Clone, Debug)]
pub struct ImageArgs {
    /// Image, a binary (.bin) or an ELF file
    #[arg(long, value_name = "FILE", conflicts_with = "board")]
    pub image: Option<PathBuf>,
    /// The installed image of this board: nucleo-h745zi-q, nucleo-h745zi-q-ldo or nucleo-h743zi2
    #[arg(long, value_name = "NAME")]
    pub board: Option<String>,
}

/// Options of `jtc firmware flash`.
#[derive(Args, Debug)]
pub struct FlashArgs {
    #[command(flatten)]
    pub image: ImageArgs,
    /// Where the drive of the board is mounted; default: the only one found
    #[arg(long, env = "JTC_DRIVE", value_name = "DIR")]
    pub drive: Option<PathBuf>,
    /// Do not ask: the arm is supported, its drives are without power, and the safety wires are as in the image
    #[arg(long)]
    pub yes: bool,
    /// The drive does not name its board: it is that of the image
    #[arg(long)]
    pub assume_board: bool,
    /// The solder bridges of the board are set to the core supply of the image
    #[arg(long)]
    pub accept_supply: bool,
    /// Flash also a board that runs this very image
    #[arg(long)]
    pub again: bool,
    /// Do not ask the controller afterwards what it runs: nothing proves that the image arrived
    #[arg(long)]
    pub no_read_back: bool,
    /// How long the board may take to run the image, s
    #[arg(long, env = "JTC_WAIT", value_name = "S", default_value_t = 120, value_parser = clap::value_parser!(u64).range(1..=3600))]
    pub wait: u64,
    #[command(flatten)]
    pub link: LinkArgs,
}
