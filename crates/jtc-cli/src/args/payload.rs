//! `jtc payload`: options for the payload at the flange.

use clap::{Args, Subcommand};
use jtc_core::Payload;

use super::LinkArgs;

/// `jtc payload …`
#[derive(Debug, Subcommand)]
pub(crate) enum PayloadCommand {
    /// Set the payload
    #[command(
        after_help = "The controller then computes the torques of the arm with this payload. The flange is \
            the last frame of the arm file.\n\n\
            In the states HoldPos and Teaching, and during a pause, the controller changes its payload \
            linearly over 0.5 s. If you start a motion during this time, the motion waits until the change \
            is complete. The controller does not store the payload. After a power cycle, the payload is \
            zero.\n\n\
            Examples:\n  \
            jtc payload set --mass 2 --com 0,0,0.08\n  \
            jtc payload set --mass 2 --com 0,0,0.08 --inertia 0.01,0.01,0.004\n  \
            jtc payload set --mass 2 --com 0.02,0,0.08 --inertia 0.01,0.01,0.004,0,-0.001,0"
    )]
    Set {
        #[command(flatten)]
        body: PayloadArgs,
        #[command(flatten)]
        link: LinkArgs,
    },
    /// Clear the payload
    #[command(after_help = "Examples:\n  jtc payload clear")]
    Clear {
        #[command(flatten)]
        link: LinkArgs,
    },
    /// Show the payload that the controller uses
    #[command(after_help = "Examples:\n  jtc payload show\n  jtc --json payload show | jq .mass_kg")]
    Show {
        #[command(flatten)]
        link: LinkArgs,
    },
}

/// Options that describe the payload at the flange.
#[derive(Args, Clone, Copy, Debug)]
pub(crate) struct PayloadArgs {
    /// Set the mass, kg
    #[arg(long, value_name = "KG", allow_hyphen_values = true)]
    pub mass: f64,
    /// Set the centre of mass in the flange frame, m
    #[arg(long, value_name = "X,Y,Z", value_parser = com, allow_hyphen_values = true)]
    pub com: [f64; 3],
    /// Set the inertia about the centre of mass, kg·m².
    ///
    /// The axes are parallel to the axes of the flange. The order is Ixx,Iyy,Izz or Ixx,Iyy,Izz,Ixy,Ixz,Iyz. Default: a point mass
    #[arg(long, value_name = "IXX,IYY,IZZ[,IXY,IXZ,IYZ]", value_parser = inertia, allow_hyphen_values = true)]
    pub inertia: Option<[f64; 6]>,
}

impl PayloadArgs {
    /// Returns the payload.
    pub(crate) fn payload(&self) -> Payload {
        let Self { mass, com, inertia } = *self;
        let [xx, yy, zz, xy, xz, yz] = inertia.unwrap_or_default();
        Payload { mass, com, inertia: [xx, xy, xz, yy, yz, zz] }
    }
}

/// Parses numbers that are separated by commas.
pub(super) fn numbers(text: &str) -> Result<Vec<f64>, String> {
    let number = |word: &str| {
        let number = word.trim().parse::<f64>().ok().filter(|number| number.is_finite());
        number.ok_or_else(|| format!("'{word}' is no number"))
    };
    text.split(',').map(number).collect()
}

fn com(text: &str) -> Result<[f64; 3], String> {
    let all = numbers(text)?;
    <[f64; 3]>::try_from(all).map_err(|all| format!("{} numbers instead of x,y,z", all.len()))
}

fn inertia(text: &str) -> Result<[f64; 6], String> {
    let mut all = numbers(text)?;
    if all.len() == 3 {
        all.resize(6, 0.0);
    }
    <[f64; 6]>::try_from(all).map_err(|all| {
        format!("{} numbers instead of three (ixx,iyy,izz) or six (ixx,iyy,izz,ixy,ixz,iyz)", all.len())
    })
}

/// Parses a point mass for the simulator, `KG` or `KG,X,Y,Z`.
pub(super) fn carried(text: &str) -> Result<Payload, String> {
    let payload = match numbers(text)?[..] {
        [mass] => Payload { mass, ..Payload::NONE },
        [mass, x, y, z] => Payload { mass, com: [x, y, z], ..Payload::NONE },
        ref all => return Err(format!("{} numbers instead of KG or KG,X,Y,Z", all.len())),
    };
    payload.check().map_err(|e| e.to_string())?;
    Ok(payload)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn j60_an_inertia_is_written_with_its_moments_first() {
        let args = |text| PayloadArgs { mass: 2.0, com: [0.0; 3], inertia: Some(inertia(text).unwrap()) };
        assert_eq!(args("1,2,3").payload().inertia, [1.0, 0.0, 0.0, 2.0, 0.0, 3.0]);
        assert_eq!(args("1, 2, 3, 4, 5, -6").payload().inertia, [1.0, 4.0, 5.0, 2.0, -6.0, 3.0]);
        assert!(inertia("1,2").is_err() && inertia("1,2,3,4").is_err() && inertia("1,2,x").is_err());
        assert!(
            com("0,0").is_err() && com("0,0,nan").is_err() && com("0,0,inf").is_err() && com("").is_err()
        );
        assert_eq!(carried("2").unwrap().mass, 2.0);
        assert_eq!(carried("2,0,0.1,-0.2").unwrap().com, [0.0, 0.1, -0.2]);
        assert!(carried("-2").is_err() && carried("2,1").is_err());
    }
}
