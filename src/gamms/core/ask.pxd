cimport cython

from gamms.core.agents cimport MoveColumns
from gamms.core.sight cimport RangeSearch, NodeViews

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


@cython.locals(one=list)
cpdef bint hold(list lists, object value)
@cython.locals(sight=RangeSearch, views=NodeViews, view=tuple, data=dict)
cdef dict look_around(object known, SensorCall look, object here)
@cython.locals(sensed=dict, seen=list, look=SensorCall)
cdef dict sense_all(tuple carried, object phase, object moment, object alike, object here, object legal)
@cython.locals(sensed=dict, state=dict, one=DecidingAgent, place=Py_ssize_t, i=Py_ssize_t, has_memories=bint, here=object)
cpdef int ask_each(
    object answers, object phase, list individuals, list sensors, list slots, MoveColumns moves, object near, object alike
) except -1
