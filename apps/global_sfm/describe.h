#pragma once

#include <string>

#include "cairn/database/database.h"
#include "cairn/scene/reconstruction.h"
#include "cairn/view_graph/view_graph_builder.h"

namespace cairn {

// What is in a database, a view graph and a model, as text for people.
std::string DescribeDatabase(const Database& database);
std::string DescribeViewGraph(const ViewGraph& graph, const ViewGraphReport& report);
std::string DescribeModel(const Reconstruction& reconstruction);

}  // namespace cairn
