//! `weathering stamps`.

use std::error::Error;
use std::path::PathBuf;

use bevy_weathering::stamps::{StampKind, StampOptions, stamps, write_stamps};
use clap::Args;

#[derive(Args, Debug)]
pub struct StampsArgs {
    /// Folder for drop_diffuse.png, drop_specular.png, drop_normal.png, drops_diffuse.png, ...
    #[arg(long)]
    pub out: PathBuf,
    /// What left the mark; can be given more than once [default: all of them]
    #[arg(long, value_enum)]
    pub kind: Vec<StampKind>,
    /// Texels along each side of a stamp: 16, 32, 64, 128 or 256
    #[arg(long, default_value_t = StampOptions::default().size, allow_negative_numbers = true)]
    pub size: u32,
    /// Stamps of each kind, side by side, 1 to 16
    #[arg(long, default_value_t = StampOptions::default().variants, allow_negative_numbers = true)]
    pub variants: u32,
    /// Another one, other stamps
    #[arg(long, default_value_t = StampOptions::default().seed, allow_negative_numbers = true)]
    pub seed: u64,
}

pub fn run(arguments: &StampsArgs) -> Result<(), Box<dyn Error>> {
    let &StampsArgs { size, variants, seed, .. } = arguments;
    let options = StampOptions { size, variants, seed };
    let all = StampKind::ALL;
    let kinds = if arguments.kind.is_empty() { all.as_slice() } else { arguments.kind.as_slice() };
    // All are made before the first is written.
    let made = kinds.iter().map(|&kind| stamps(kind, &options).map(|strips| (kind, strips)));
    let made: Vec<_> = made.collect::<Result<_, _>>()?;
    for (kind, strips) in &made {
        for path in write_stamps(&arguments.out, *kind, strips)? {
            crate::print(path.display())?;
        }
    }
    Ok(())
}
