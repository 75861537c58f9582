// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "evpose/core/error.h"
#include "evpose/imu/imu.h"

namespace evpose {

struct ImuReadOptions {
  std::string time_unit = "ns";  ///< "ns", "us" or "s"
  bool gyro_in_degrees = false;  ///< deg/s in the file
  bool accel_in_g = false;       ///< multiples of 9.80665 m/s^2 in the file
  std::vector<std::string>
      columns;               ///< in file order; empty: timestamp_ns wx wy wz ax ay az. Others are ignored
  double max_gap_s = 0.1;    ///< a longer one is an error
  double warn_gap_s = 0.05;  ///< longer ones are counted and warned of at the end
  std::optional<TimeNs> t_start_ns;  ///< samples more than max_gap_s before are left out, unchecked
  std::optional<TimeNs> t_end_ns;    ///< samples more than max_gap_s after are left out, unchecked
};

/// Streams imu.csv. Errors name the line: not a number, stamps that repeat or go back, a gap.
class ImuReader {
 public:
  static Expected<ImuReader> open(const std::string& path, const ImuReadOptions& options = {});
  /// Samples of another file, held in memory, with the same checks; errors name `path` and the sample.
  static Expected<ImuReader> of_samples(const std::string& path,
                                        std::shared_ptr<const std::vector<ImuSample>> samples,
                                        const ImuReadOptions& options = {});
  ImuReader(ImuReader&& other) noexcept;
  ImuReader& operator=(ImuReader&& other) noexcept;
  ~ImuReader();

  /// False at the end.
  Expected<bool> next(ImuSample& sample);

 private:
  struct Impl;
  explicit ImuReader(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

Expected<std::vector<ImuSample>> read_imu_csv(const std::string& path, const ImuReadOptions& options = {});

/// Numbers read back to 1e-9. Samples in order of time: a fault of ours otherwise.
Status write_imu_csv(const std::string& path, const std::vector<ImuSample>& samples);

}  // namespace evpose
