#include "stages/replay/count.h"

#include <fmt/format.h>

#include <cstdlib>
#include <string>
#include <utility>

#include "stages/data/machine.h"

namespace lamina::replay {

Status check_count(const Machine& machine, const Count& reported, const Count& found) {
  const auto wrong = [](std::string what) { return Error{Fault::kVerification, std::move(what)}; };
  if (found.drops != reported.drops || found.spat != reported.spat) {
    return wrong(fmt::format("{} drops and {} off the bed, the manifest says {} and {}", found.drops, found.spat,
                             reported.drops, reported.spat));
  }
  if (found.sweeps != reported.sweeps)
    return wrong(fmt::format("{} sweeps fire, the manifest says {}", found.sweeps, reported.sweeps));
  // Further sweeps for blocked nozzles are over no place of their own.
  const auto& head = machine.head;
  const bool counted = head.max_drops > 1 && (head.blocked.empty() || head.blocked_rule != BlockedRule::kSecondPass);
  if (counted && found.added != reported.added) {
    return wrong(
        fmt::format("{} sweeps are there for the head's frequency, the manifest says {}", found.added, reported.added));
  }
  if (reported.microseconds > 0 && std::abs(found.microseconds - reported.microseconds) > 1)
    return wrong(fmt::format("takes {:.6f} s, the manifest says {:.6f}", found.seconds(), reported.seconds()));
  // Of two times, each a whole number.
  if (counted && reported.microseconds > 0 && std::abs(found.added_microseconds - reported.added_microseconds) > 2) {
    return wrong(fmt::format("{:.6f} s are for sweeps that the head's frequency adds, the manifest says {:.6f}",
                             1e-6 * static_cast<double>(found.added_microseconds),
                             1e-6 * static_cast<double>(reported.added_microseconds)));
  }
  return {};
}

}  // namespace lamina::replay
