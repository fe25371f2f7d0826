// pipeline/report/observer.h: what counts, warns and reports while layers are made. Makers only make them.
//
// A new figure of the summary is a new observer in the list of its product (image_observers.h,
// path_observers.h). One observer counts one thing.
#pragma once

#include <memory>
#include <utility>
#include <vector>

#include "pipeline/manifest/record.h"
#include "pipeline/report/summary.h"
#include "stages/data/status.h"

namespace lamina::pipeline {

/// Made: what making a layer found beyond its record; void if nothing.
template <class Made>
class Observer {
 public:
  virtual ~Observer() = default;
  /// In layer order, one at a time. made  null for a layer that --resume kept
  virtual void layer(const LayerRecord& record, const Made* made) = 0;
  /// After the last layer, before report(). summary  what is known so far
  virtual void warn(const Summary& summary, std::vector<Warning>& warnings) {
    static_cast<void>(summary), static_cast<void>(warnings);
  }
  /// Adds lines and facts.
  virtual void report(Summary& summary) const { static_cast<void>(summary); }
};

/// Observers in the order of their lines and warnings.
template <class Made>
class Observers {
 public:
  /// returns  the observer, owned by the list
  template <class Kind, class... Arguments>
  Kind& add(Arguments&&... arguments) {
    auto made = std::make_unique<Kind>(std::forward<Arguments>(arguments)...);
    Kind& observer = *made;
    observers_.push_back(std::move(made));
    return observer;
  }

  void layer(const LayerRecord& record, const Made* made) {
    for (const auto& observer : observers_) observer->layer(record, made);
  }
  void warn(const Summary& summary, std::vector<Warning>& warnings) const {
    for (const auto& observer : observers_) observer->warn(summary, warnings);
  }
  void report(Summary& summary) const {
    for (const auto& observer : observers_) observer->report(summary);
  }

 private:
  std::vector<std::unique_ptr<Observer<Made>>> observers_;
};

}  // namespace lamina::pipeline
