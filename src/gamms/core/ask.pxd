cimport cython

from gamms.core cimport travel
from gamms.core.agents cimport AgentColumns, MoveColumns, MovingAgents
from gamms.core.sight cimport RangeSearch, NodeViews
from gamms.core.travel cimport GoalPaths, PathsBySlot, ReachSearch, RoadEdges, TurnPaths

ctypedef long long i64

cdef extern from "Python.h":
    cpdef dict as_dict "Py_NewRef" (object value)

@cython.final
cdef class StateKey:
    cdef readonly str name


@cython.final
cdef class SensorCall:
    cdef readonly object name, last, kind, sensor
    cdef readonly int number


@cython.final
cdef class DecidingAgent:
    cdef readonly object agent, strategy, template, team
    cdef readonly tuple sensors
    cdef readonly list last
    cdef readonly bint travels
    cdef readonly object speed


cdef class TravelSearch:
    cdef public double now
    cdef public bint at_arrivals
    cdef RoadEdges map
    cdef ReachSearch reach
    cdef GoalPaths ways
    cdef TurnPaths trips
    cdef list ids, xy
    cdef object row_of, edge_row_of, lines
    cdef public object found_on

    @cython.locals(node=i64, edge=i64, share=double, motion=i64, pace=double, count=i64, number=i64, found=list)
    cpdef tuple list_legal(self, object here, object place, object speed)
    @cython.locals(edge=i64, points=list, lengths=list)
    cpdef int show(self, object state, object here, object place) except -1
    @cython.locals(node=i64, edge=i64, share=double, motion=i64, pace=double, most=i64)
    cpdef int begin(self, object here, object place, object speed) except -1
    cpdef bint go_towards(self, i64 agent, object here, object place, object speed, object target) except -1
    cpdef int put(self, PathsBySlot paths, i64 i) except -1
    cpdef object end(self)


@cython.locals(left=double, i=Py_ssize_t, length=double, x0=double, y0=double, x1=double, y1=double, dx=double, dy=double)
cpdef tuple find_point(list points, list lengths, double share)


@cython.locals(sight=RangeSearch, views=NodeViews, view=tuple, data=dict)
cdef dict look_around(object known, SensorCall look, object here)
@cython.locals(sensed=dict, seen=list, look=SensorCall)
cdef dict sense_all(tuple carried, object phase, object moment, object alike, object here, object legal)
@cython.locals(sensed=dict, state=dict, one=DecidingAgent, place=Py_ssize_t, i=Py_ssize_t, has_memories=bint, here=object, legal=object, paths=TravelSearch, where=object, columns=AgentColumns)
cpdef int ask_each(
    object answers, object phase, list individuals, list sensors, list slots, MoveColumns moves, object near, object alike,
    MovingAgents movers, object search
) except -1
