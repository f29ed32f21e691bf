#define_import_path bevy_weathering::film_on_pores

// Pores (`hnat`) and a film over the solid between them (`lekner_dorf`) in one surface. The function has a
// double-precision twin of the same name in `material::models::film_on_pores`, where the story is told. No units.

#import bevy_weathering::lekner_dorf::wet_diffuse

// What the film takes off the diffuse coefficient: (kd - wet kd) (1 - alpha G) c.
// kd: of the solid; alpha_poro, g: part of the surface that is pore mouths; x, p: of the film, see `lekner_dorf`;
// coverage: c, part of the solid under the film.
fn film_darkening(kd: vec3<f32>, alpha_poro: f32, g: f32, x: f32, p: f32, coverage: f32) -> vec3<f32> {
    return (kd - wet_diffuse(kd, x, p)) * ((1.0 - alpha_poro * g) * coverage);
}
