// Strays all over the space around a cloud, which keep each other company.
#pragma once
#include "lamina/run.h"
#include "samples/cleaning.h"
#include "store/slab_store.h"

namespace lamina {

/// Which samples fill space instead of lying on surfaces. A dozen outliers look flat by chance, and normals found from
/// them agree, since neighbours share theirs; that a dozen dozens look flat is rare. So the thickness of a sample's
/// dozen is averaged over the dozen, and that again. What tests of single samples have left is flat because they chose
/// it: the averages are of all samples that are `far` from their neighbours, found to be strays or not, and of no
/// others. `reach` in steps: those without a dozen so near are looked at again among themselves, as drop_strays() does.
/// Depends on the cloud alone. Memory: some 110 bytes for each far sample of eighteen reaches of the cloud's height,
/// and bits.
KeepMasks find_clutter(const SlabStore& store, const KeepMasks& far, double reach, const RunContext& run);

}  // namespace lamina
