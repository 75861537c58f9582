// SPDX-License-Identifier: BSD-3-Clause
#include <sqlite3.h>

#include <filesystem>
#include <unordered_map>

#include "evpose/io/bags/rosbag2.h"
#include "evpose/io/files/compression.h"
#include "evpose/io/files/input_file.h"

namespace evpose {
namespace {

/// Work on one row, in rounds of as many steps of SQLite's machine. A sound file needs a handful of steps,
/// and to count all its messages a few for each; none is shorter than 20 bytes.
constexpr int kStepsOfRound = 1'000'000;
struct Effort {
  std::int64_t rounds = 0, most = 0;
};
std::int64_t most_rounds(std::int64_t file_bytes) { return 2 + 4 * file_bytes / kStepsOfRound; }

struct CloseDatabase {
  void operator()(sqlite3* database) const { sqlite3_close_v2(database); }
};
struct FinalizeStatement {
  void operator()(sqlite3_stmt* statement) const { sqlite3_finalize(statement); }
};
using Database = std::unique_ptr<sqlite3, CloseDatabase>;
using Statement = std::unique_ptr<sqlite3_stmt, FinalizeStatement>;

/// SQLite's form of a path in a URI.
std::string percent_encoded(const std::string& path) {
  std::string out;
  for (const char c : path) {
    if (c == '%' || c == '?' || c == '#')
      out += text('%', std::hex, static_cast<int>(c));
    else
      out += c;
  }
  return out;
}

std::string column_text(sqlite3_stmt* statement, int column) {
  const auto* value = reinterpret_cast<const char*>(sqlite3_column_text(statement, column));
  return value != nullptr
             ? std::string(value, static_cast<std::size_t>(sqlite3_column_bytes(statement, column)))
             : std::string();
}

std::string plain_type(std::string type) {
  if (const auto middle = type.find("/msg/"); middle != std::string::npos) type.erase(middle, 4);
  return type;
}

class SqliteReader : public BagReader {
 public:
  SqliteReader(std::string path, bool messages_are_zstd) : path_(std::move(path)), zstd_(messages_are_zstd) {}

  Status open();
  Status select(const std::vector<std::size_t>& topics) override;
  Expected<bool> next(BagMessage& message) override;
  Status rewind() override { return query(""); }
  Status go_to_last(std::size_t topic) override;
  Status count_messages() override;

 private:
  Status open_database();
  Status check_tables();
  Status read_topics();
  Expected<Statement> prepare(const std::string& sql) const;
  Expected<bool> step(sqlite3_stmt* statement);
  Status query(const std::string& condition);
  Error damaged(const std::string& what) const {
    return Error{path_, what, "copy the bag again from its source, or repair it by `sqlite3 FILE .recover`"};
  }

  std::string path_;
  bool zstd_;
  Database database_;
  Statement messages_;  // goes before the database
  bool by_time_ = false;
  std::vector<std::int64_t> ids_;  ///< of each topic
  std::unordered_map<std::int64_t, std::size_t> topic_of_id_;
  std::string selected_;  ///< ids, joined by commas
  std::int64_t last_t_ = 0, last_id_ = 0;
  bool has_last_ = false, ended_ = false;
  Effort effort_;
  std::vector<std::byte> room_;
};

Status SqliteReader::open_database() {
  // A log beside the file holds messages of a recording that was not closed; without one nothing may change.
  std::error_code ignored;
  const auto log_size = std::filesystem::file_size(path_ + "-wal", ignored);
  const bool has_log = !ignored && log_size > 0;
  const std::string uri =
      "file:" + percent_encoded(path_) + "?mode=ro" + (has_log ? std::string() : "&immutable=1");
  sqlite3* raw = nullptr;
  const int result = sqlite3_open_v2(uri.c_str(), &raw,
                                     SQLITE_OPEN_READONLY | SQLITE_OPEN_URI | SQLITE_OPEN_NOMUTEX, nullptr);
  database_.reset(raw);
  if (result != SQLITE_OK) return damaged("cannot be opened as a database");
  sqlite3_limit(raw, SQLITE_LIMIT_LENGTH, static_cast<int>(kLargestChunk));
  sqlite3_db_config(raw, SQLITE_DBCONFIG_DEFENSIVE, 1, nullptr);
  sqlite3_db_config(raw, SQLITE_DBCONFIG_TRUSTED_SCHEMA, 0, nullptr);
  sqlite3_db_config(raw, SQLITE_DBCONFIG_ENABLE_VIEW, 0, nullptr);
  // Tables that lead in circles would keep SQLite busy for ever.
  const auto too_long = [](void* context) {
    auto& effort = *static_cast<Effort*>(context);
    return ++effort.rounds > effort.most ? 1 : 0;
  };
  sqlite3_progress_handler(raw, kStepsOfRound, too_long, &effort_);
  return {};
}

Expected<Statement> SqliteReader::prepare(const std::string& sql) const {
  sqlite3_stmt* statement = nullptr;
  if (sqlite3_prepare_v2(database_.get(), sql.c_str(), -1, &statement, nullptr) != SQLITE_OK)
    return damaged(text("is not a ROS 2 bag, or a damaged one (", sqlite3_errmsg(database_.get()), ")"));
  return Statement(statement);
}

/// True if there is a row.
Expected<bool> SqliteReader::step(sqlite3_stmt* statement) {
  effort_.rounds = 0;
  const int result = sqlite3_step(statement);
  if (result == SQLITE_ROW) return true;
  if (result == SQLITE_DONE) return false;
  return damaged(text("the database is damaged (", sqlite3_errmsg(database_.get()), ")"));
}

/// Real tables only: a view may compute anything.
Status SqliteReader::check_tables() {
  auto tables = prepare(
      "SELECT count(*) FROM sqlite_master WHERE type = 'table' AND name IN ('topics', 'messages') "
      "AND rootpage > 0");
  if (!tables) return tables.error();
  const auto row = step(tables->get());
  if (!row) return row.error();
  if (sqlite3_column_int(tables->get(), 0) != 2)
    return Error{path_, "is a database without the tables of a ROS 2 bag", "check the path"};
  auto index = prepare(
      "SELECT count(*) FROM sqlite_master WHERE type = 'index' AND name = 'timestamp_idx' "
      "AND tbl_name = 'messages'");
  if (!index) return index.error();
  const auto index_row = step(index->get());
  if (!index_row) return index_row.error();
  by_time_ = sqlite3_column_int(index->get(), 0) == 1;
  return {};
}

Status SqliteReader::read_topics() {
  auto statement = prepare("SELECT id, name, type, serialization_format FROM topics ORDER BY id");
  if (!statement) return statement.error();
  while (true) {
    const auto row = step(statement->get());
    if (!row) return row.error();
    if (!*row) return {};
    const std::int64_t id = sqlite3_column_int64(statement->get(), 0);
    if (!topic_of_id_.emplace(id, topics_.size()).second) return damaged("two topics have one id");
    ids_.push_back(id);
    const auto wire = column_text(statement->get(), 3) == "cdr" ? Wire::cdr : Wire::other;
    topics_.push_back(
        {column_text(statement->get(), 1), plain_type(column_text(statement->get(), 2)), wire, "", -1});
  }
}

Status SqliteReader::open() {
  const auto file = open_to_read(path_);
  if (!file) return file.error();
  effort_.most = most_rounds(file->size);
  if (auto status = open_database(); !status) return status;
  if (auto status = check_tables(); !status) return status;
  if (auto status = read_topics(); !status) return status;
  std::vector<std::size_t> all;
  for (std::size_t i = 0; i < topics_.size(); ++i) all.push_back(i);
  return select(all);
}

Status SqliteReader::query(const std::string& condition) {
  // Without the index SQLite would sort whole messages.
  const std::string order = by_time_ ? "timestamp, id" : "id",
                    by_index = by_time_ ? " INDEXED BY timestamp_idx" : "";
  auto statement = prepare("SELECT topic_id, timestamp, id, data FROM messages" + by_index +
                           " WHERE topic_id IN (" + selected_ + ")" + condition + " ORDER BY " + order);
  if (!statement) return statement.error();
  messages_ = *std::move(statement);
  has_last_ = ended_ = false;
  return {};
}

Status SqliteReader::select(const std::vector<std::size_t>& topics) {
  selected_.clear();
  for (const std::size_t topic : topics) {
    if (!selected_.empty()) selected_ += ',';
    selected_ += std::to_string(ids_[topic]);
  }
  return rewind();
}

Status SqliteReader::go_to_last(std::size_t topic) {
  const std::string key = by_time_ ? "timestamp" : "id";
  auto statement =
      prepare("SELECT " + key + " FROM messages WHERE topic_id = " + std::to_string(ids_[topic]) +
              " ORDER BY " + key + " DESC LIMIT 1");
  if (!statement) return statement.error();
  const auto row = step(statement->get());
  if (!row) return row.error();
  if (!*row) return rewind();
  return query(" AND " + key + " >= " + std::to_string(sqlite3_column_int64(statement->get(), 0)));
}

Status SqliteReader::count_messages() {
  auto statement = prepare("SELECT topic_id, count(*) FROM messages GROUP BY topic_id");
  if (!statement) return statement.error();
  for (BagTopic& topic : topics_) topic.messages = 0;
  while (true) {
    const auto row = step(statement->get());
    if (!row) return row.error();
    if (!*row) return {};
    const auto topic = topic_of_id_.find(sqlite3_column_int64(statement->get(), 0));
    if (topic != topic_of_id_.end())
      topics_[topic->second].messages += sqlite3_column_int64(statement->get(), 1);
  }
}

Expected<bool> SqliteReader::next(BagMessage& message) {
  if (ended_) return false;  // another step would begin again
  const auto row = step(messages_.get());
  if (!row) return row.error();
  ended_ = !*row;
  if (ended_) return false;
  sqlite3_stmt* s = messages_.get();
  const auto topic = topic_of_id_.find(sqlite3_column_int64(s, 0));
  const std::int64_t t = sqlite3_column_int64(s, 1), id = sqlite3_column_int64(s, 2);
  const bool ordered =
      !has_last_ || (by_time_ ? t > last_t_ || (t == last_t_ && id > last_id_) : id > last_id_);
  if (topic == topic_of_id_.end() || !ordered)
    return damaged(text("message ", id, " is out of order: the database is damaged"));
  last_t_ = t, last_id_ = id, has_last_ = true;
  const auto* blob = static_cast<const std::byte*>(sqlite3_column_blob(s, 3));
  std::span<const std::byte> data(blob,
                                  blob != nullptr ? static_cast<std::size_t>(sqlite3_column_bytes(s, 3)) : 0);
  if (zstd_) {
    const auto size =
        decompress(Compression::zstd, data, kLargestChunk, text(path_, ", message ", id), room_);
    if (!size) return size.error();
    data = std::span(room_).first(*size);
  }
  message = {topic->second, t, data};
  return true;
}

}  // namespace

Expected<std::unique_ptr<BagReader>> open_rosbag2_sqlite(const std::string& path, bool messages_are_zstd) {
  auto reader = std::make_unique<SqliteReader>(path, messages_are_zstd);
  if (auto status = reader->open(); !status) return status.error();
  return std::unique_ptr<BagReader>(std::move(reader));
}

}  // namespace evpose
