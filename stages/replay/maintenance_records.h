// stages/replay/maintenance_records.h: care of head and powder in programs of raw and planes, as their READMEs tell it.
#pragma once

#include "stages/replay/bytes.h"

namespace lamina::replay {

/// Carries out the records of care that follow, as many as there are. The dialect is that of the profile.
void take_maintenance_records(ByteReader& reader, Printing& printing, Passes& passes);

}  // namespace lamina::replay
