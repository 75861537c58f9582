// SPDX-License-Identifier: BSD-3-Clause
// Files of events, format by format.
#include "fuzz.h"

EVPOSE_FUZZ_TARGET(events_raw) { evpose::fuzz::read_all(bytes, "raw"); }
EVPOSE_FUZZ_TARGET(events_dat) { evpose::fuzz::read_all(bytes, "dat"); }
EVPOSE_FUZZ_TARGET(events_aedat4) { evpose::fuzz::read_all(bytes, "aedat4"); }
EVPOSE_FUZZ_TARGET(events_aedat3) { evpose::fuzz::read_all(bytes, "aedat3"); }
EVPOSE_FUZZ_TARGET(events_aedat2) { evpose::fuzz::read_all(bytes, "aedat2"); }
EVPOSE_FUZZ_TARGET(events_es) { evpose::fuzz::read_all(bytes, "es"); }
EVPOSE_FUZZ_TARGET(events_bin40) { evpose::fuzz::read_all(bytes, "bin40"); }
EVPOSE_FUZZ_TARGET(events_text) { evpose::fuzz::read_all(bytes, "text"); }
