// How far samples scatter about the surface they lie on, from a few neighbourhoods.
#pragma once
#include "samples/radii.h"

namespace lamina {

/// The median over some hundred samples of the distance to the plane, or sphere, that their neighbours within two radii
/// suggest, in units of `radius` (the cloud's median radius, steps). Exact samples of a surface that the radius
/// resolves have under 0.02; uniform noise of half a local spacing either way on each coordinate has some 0.1. The
/// neighbours' positions decide, not the samples' own normals. A function of the store alone; reads about 2^17 samples,
/// and at most four runs of buckets. 0 where too few samples have neighbours to tell.
float survey_noise(const SlabStore& store, const ReadBucket& read, float radius);

}  // namespace lamina
