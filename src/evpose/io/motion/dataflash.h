// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "evpose/io/events/sensor_streams.h"
#include "evpose/io/files/byte_stream.h"

namespace evpose {

/// A kind of record of an ArduPilot DataFlash log, as the log itself describes it.
struct DataFlashType {
  struct Field {
    std::string name;
    char format = 0;         ///< as in the log's FMT records
    std::size_t offset = 0;  ///< in the record's body
    double multiplier = 0;   ///< from FMTU and MULT; 0: none given
    std::string unit;        ///< from FMTU and UNIT; empty: none given
  };
  std::string name;
  std::size_t body = 0;       ///< bytes
  std::vector<Field> fields;  ///< empty if they do not fit the body

  /// The field of that name, or nullptr.
  const Field* find(std::string_view field) const;
};

struct DataFlashRecord {
  const DataFlashType* type = nullptr;
  std::span<const std::byte> body;  ///< holds until the reader's next call

  /// A number, with the log's multiplier, or the one that its format implies. Text and arrays: 0.
  double number(const DataFlashType::Field& field) const;
  /// A whole number as stored; 0 for what is none.
  std::int64_t integer(const DataFlashType::Field& field) const;
  std::string text(const DataFlashType::Field& field) const;
};

/// Records in the order of the file. Bytes that are no record are passed over to the next one that is, and
/// told of by a warning at the end, as is a last record that was cut off.
class DataFlashReader {
 public:
  static Expected<DataFlashReader> open(const std::string& path);

  /// False at the end.
  bool next(DataFlashRecord& record);

  std::int64_t byte() const { return record_byte_; }  ///< where the record given last begins
  std::int64_t unused_bytes() const { return unused_; }

 private:
  explicit DataFlashReader(ByteStream stream);
  void learn(const DataFlashRecord& record);
  void add_type(std::span<const std::byte> body);
  void add_units(const DataFlashRecord& record);
  bool find_record();

  ByteStream stream_;
  std::array<std::unique_ptr<DataFlashType>, 256> types_;
  std::array<double, 256> multipliers_{};
  std::array<std::string, 256> units_;
  std::size_t to_skip_ = 0;
  std::int64_t record_byte_ = 0, unused_ = 0;
  bool told_ = false;
};

bool starts_as_dataflash(std::string_view head);

/// IMU records become samples, on the autopilot's clock and in its axes (x forward, y right, z down). Streams
/// are named as their records, IMU, IMU2, or IMU[0], IMU[1] where records number their sensors.
Status read_dataflash_sensors(const std::string& path, const std::string& name, const SensorSink& sink);

/// One stream for each kind of record.
Expected<std::vector<StreamInfo>> list_dataflash_streams(const std::string& path);

}  // namespace evpose
