//! `weathering wet-texture`.

use std::error::Error;

use bevy_weathering::bake::{WetTexture, read_texture, wet_texture, write_texture};

use crate::cli::{TextureModel, WetTextureArgs};

pub fn run(arguments: &WetTextureArgs) -> Result<(), Box<dyn Error>> {
    let porosity = arguments.porosity;
    let how = match arguments.model {
        None => WetTexture::Spectral { shift: arguments.shift, lerp: arguments.lerp },
        Some(TextureModel::Ld) => WetTexture::LeknerDorf { porosity },
        Some(TextureModel::Tbm) => WetTexture::Twomey { porosity },
        Some(TextureModel::Lagarde) => WetTexture::Lagarde { porosity },
    };
    let out = arguments.out.clone().unwrap_or_else(|| {
        let mut name = arguments.file.file_stem().unwrap_or_default().to_os_string();
        name.push("_wet.png");
        arguments.file.with_file_name(name)
    });
    let wet = wet_texture(&read_texture(&arguments.file)?, &how)?;
    write_texture(&out, &wet)?;
    crate::print(out.display())
}
